"""Checks and conversions of arguments. Values of parameters are given by name, or in a file such as `prw identify` writes."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Collection, Iterable, Mapping, Sequence
from numbers import Integral, Real
from pathlib import Path
from typing import Any, TypeGuard

import fmu_run
import numpy as np
from numpy.typing import NDArray

from prw.errors import UserError
from prw.files import read_text

#: A larger relative standard deviation is probably a mistake: percent instead of a fraction.
MAX_RELATIVE = 1.0
#: Members of a parameter in a file, as `build_fmu` reads them.
ENTRY = ("value", "unit", "meaning")
#: A table in memory, with columns by name.
Table = Mapping[str, Any]


def names_of(argument: str, given: str | Iterable[str]) -> tuple[str, ...]:
    """One or more names, as a tuple. Raises UserError if `given` is neither a name nor a sequence."""
    if isinstance(given, str):
        return (given,)
    if not isinstance(given, Iterable):
        raise UserError(f"{given!r} is neither a name nor a sequence of names", argument=argument)
    return tuple(given)


def check_names(argument: str, names: Iterable[str], known: Collection[str], others: str = "") -> None:
    """Raise UserError for a name that is not among the `known` ones. others: text that the message adds after the known names."""
    for name in names:
        if name not in known:
            raise UserError(f"{name} is not known; there are {', '.join(known)}{others}", argument=argument)


def counted(argument: str, value: Any, least: int = 1) -> int:
    """The value as an int. Raises UserError unless it is an integer of at least `least`."""
    if not isinstance(value, Integral) or isinstance(value, bool) or value < least:
        raise UserError(f"must be an integer of at least {least}", argument=argument, given=repr(value))
    return int(value)


def positive(argument: str, value: Any, name: str = "") -> float:
    """The value as a float. Raises UserError unless it is finite and above 0. name: the parameter or channel that has the value."""
    if not is_real(value) or not 0 < float(value) < math.inf:
        raise UserError(f"{name} {value!r} is not a finite number above 0".lstrip(), argument=argument)
    return float(value)


def not_negative(argument: str, value: Any, name: str = "") -> float:
    """The value as a float. Raises UserError unless it is finite and 0 or above. name: the parameter that has the value."""
    if not is_real(value) or not 0 <= float(value) < math.inf:
        raise UserError(f"{name} {value!r} is not a finite number of at least 0".lstrip(), argument=argument)
    return float(value)


def flag(argument: str, value: Any) -> bool:
    """The value as a bool. Raises UserError unless it is a Boolean, because Python takes "no" for true."""
    if not isinstance(value, (bool, np.bool_)):
        raise UserError("must be True or False", argument=argument, given=repr(value))
    return bool(value)


def is_real(value: Any) -> TypeGuard[float]:
    """Whether the value is a number, which Python says of Booleans, too."""
    return isinstance(value, Real) and not isinstance(value, bool)


def spread_of(argument: str, name: str, given: Any, start: float) -> tuple[float, float]:
    """The central value of a parameter and its relative standard deviation. `given` is (value, deviation), or only the
    deviation; then the central value is `start`. Raises UserError if a number is out of range."""
    if isinstance(given, Sequence) and len(given) != 2:
        raise UserError(f"{name} {given!r}: write a fraction as in 0.1, or (value, fraction)", argument=argument)
    value, relative = given if isinstance(given, Sequence) else (start, given)
    if value is start and start == 0:
        raise UserError(
            f"{name} starts at 0; write (value, fraction), as an option NAME=VALUE:PERCENT%", argument=argument
        )
    value, relative = positive(argument, value, name), positive(argument, relative, name)
    if relative > MAX_RELATIVE:
        raise UserError(
            f"{name} has a standard deviation of {relative:.0%}; 100 % is the most, a fraction of 1", argument=argument
        )
    return value, relative


def spelled(argument: str, value: Any, command: bool) -> str:
    """An argument in the syntax of Python, or as options of the command: `gain=["tau1"]` or `--gain tau1`. value: names, or fractions
    by name."""
    if isinstance(value, Mapping):
        options = " ".join(f"--{argument.removesuffix('s')} {name}={100 * x:g}%" for name, x in value.items())
        return f"`{options}`" if command else f"`{argument}={json.dumps(value)}`"
    return f"`--{argument} {','.join(value)}`" if command else f"`{argument}={json.dumps(list(value))}`"


def is_path(given: Any) -> bool:
    """Whether the argument is a string or a path."""
    return isinstance(given, (str, os.PathLike))


def is_table(given: Any) -> bool:
    """Whether the argument has columns by name, as a DataFrame or a dict of arrays has."""
    return not is_path(given) and (hasattr(given, "keys") or hasattr(given, "columns"))


def columns_of(table: Any) -> dict[str, Any]:
    """The columns of a DataFrame (of pandas, polars, ...) or a dict of arrays; a named index becomes the first
    column. Raises UserError if a column has the name of the index, but other values."""
    names = table.keys() if hasattr(table, "keys") else table.columns
    index = getattr(getattr(table, "index", None), "name", None)
    if index is not None and index in names and not np.array_equal(np.asarray(table.index), np.asarray(table[index])):
        raise UserError(f"the index and a column of the table are both called {index}; rename or remove one")
    first = {} if index is None or index in names else {str(index): table.index}
    return first | {str(name): table[name] for name in names}


def numbers_of(where: str, values: Any) -> NDArray[np.float64]:
    """The values as a column (n,) of floats, as `floats_of`. Raises UserError also if they are not one column."""
    array = floats_of(where, values)
    if array.ndim != 1:
        raise UserError(f"{where}: has the shape {array.shape}; a column is (n,)")
    return array


def floats_of(where: str, values: Any) -> NDArray[np.float64]:
    """The values as an array of floats; masked and missing values become NaN. Raises UserError, with a message that begins with
    `where`, if they are not numbers."""
    if isinstance(values, tuple) and len(values) == 2 and isinstance(values[1], str):
        raise UserError(f"{where}: is a pair of values and a unit, but must be a column of numbers")
    try:
        array = np.asarray(values)
        kind = array.dtype.kind
        missing = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
        # pandas.NA cannot be converted.
        if kind == "O" and hasattr(values, "isna"):
            missing = values.isna()
        if kind == "O" and missing is not None:
            array = np.where(missing, np.nan, array)
        # numpy would convert "1_000" and True, and a Boolean in a list is a number in the array.
        listed = isinstance(values, (list, tuple))
        each = np.asarray(values, dtype=object).flat if kind == "O" or listed else ()
        texts = kind in "USTb" or any(isinstance(x, (str, bytes, bool, np.bool_)) for x in each)
        dates = kind in "mM"
        array = np.zeros(array.shape) if dates or kind == "c" else array.astype(np.float64)
        if missing is not None:
            array[missing] = np.nan
    except (TypeError, ValueError) as error:
        raise UserError(f"{where}: does not consist of numbers ({error})") from None
    if texts:
        raise UserError(f"{where}: does not consist of numbers; convert strings and Booleans first")
    if kind == "c":
        raise UserError(f"{where}: has complex numbers; choose their real part or magnitude")
    if dates:
        raise UserError(f"{where}: has dates or durations; write seconds as numbers")
    return array


def finite_numbers(values: Any) -> NDArray[np.float64] | None:
    """One number or a column of numbers as a column, or None if they are not that, or not finite."""
    try:
        found = numbers_of("", values if np.ndim(values) else [values])
    except ValueError:
        return None
    return found if np.isfinite(found).all() else None


#: Values by name, in the FMU's units (SI for the testbed) or as (value, unit), or the path of a JSON file with them.
Given = Mapping[str, Any] | str | os.PathLike[str] | None


def values_of(given: Given, loaded: fmu_run.Fmu) -> dict[str, Any]:
    """Values by name in the units of the FMU. Raises UserError for a file that cannot be read, an entry in it that is not a number,
    or a unit that cannot be converted."""
    if given is None:
        return {}
    if isinstance(given, Mapping):
        return {name: in_own_unit(name, value, loaded) for name, value in given.items()}
    if not is_path(given):
        raise UserError(
            f"{given!r} is neither a mapping from names to values nor the path of a JSON file with such a mapping",
            argument="parameters",
        )
    path = Path(given)
    why, content = "", None
    try:
        content = json.loads(read_text(path), object_pairs_hook=_without_repetitions)
    except OSError as error:
        raise UserError(f"{path} cannot be read ({error.strerror or error})", argument="parameters") from None
    except UserError as error:
        raise UserError(f"{path}: {error}", argument="parameters") from None
    except json.JSONDecodeError as error:
        why = f" ({error.msg} in line {error.lineno}, column {error.colno})"
    except UnicodeError:
        why = "; if it is an FMU, pass it as `fmu` (--fmu)"
    except (ValueError, RecursionError):
        pass
    if not isinstance(content, dict):
        raise UserError(f"{path} is not a JSON file with values by name{why}", argument="parameters")
    inner = content.get("parameters")
    if not isinstance(inner, dict):
        return {name: _value(path, name, entry, loaded, False) for name, entry in content.items()}
    # A report of `identify` has a member `fmu`, and its parameters are in a member of their own.
    report = "fmu" in content
    if report and content.get("identified", True) is not True:
        raise UserError(
            f"{path}: reports that the data did not determine the parameters, or that the FMU does not explain the data; if you want "
            "its values nevertheless, give them by name",
            argument="parameters",
        )
    for name in content:
        if name != "parameters" and (name in loaded.variables or not report):
            raise UserError(f'{path}: {name} is outside of "parameters"; move it there', argument="parameters")
    return {name: _value(path, name, entry, loaded, report) for name, entry in inner.items()}


def _without_repetitions(members: list[tuple[str, Any]]) -> dict[str, Any]:
    """The members of a JSON object. Raises UserError if two have the same name."""
    found = dict(members)
    if len(found) < len(members):
        names = [name for name, _ in members]
        raise UserError(f"{next(name for name in names if names.count(name) > 1)} is given twice")
    return found


def in_own_unit(name: str, value: Any, loaded: fmu_run.Fmu, where: str = "", argument: str = "parameters") -> Any:
    """The value of a pair (value, unit), converted to the unit of the FMU's variable. Any other value, and the value of an unknown
    variable, is returned unchanged. Raises UserError for `argument`, with a message that begins with `where`, for a unit that cannot be
    converted, or for a Boolean in place of a number."""
    if name not in loaded.variables:
        return value
    pair = isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], str)
    if isinstance(value[0] if pair else value, (bool, np.bool_)) and loaded.variables[name].type != "Boolean":
        raise UserError(f"{where}{name} is {value!r}, not a number", argument=argument)
    if not pair:
        return value
    numbers = finite_numbers(value[0])
    if numbers is None:
        raise UserError(f"{where}{name} is {value!r}; write finite numbers and their unit", argument=argument)
    try:
        return loaded.converted(name, numbers if np.ndim(value[0]) else numbers[0], value[1])
    except ValueError as error:
        raise UserError(f"{where}{error}", argument=argument) from None


def _value(path: Path, name: str, entry: Any, loaded: fmu_run.Fmu, report: bool) -> Any:
    """An entry of the file, converted to the FMU's unit. The entry is a number in that unit, or a dict with a value and
    its unit; in the report of an identification, it has further members. Raises UserError for any other entry, or a unit that
    cannot be converted."""
    value, unit = (entry.get("value"), str(entry.get("unit", ""))) if isinstance(entry, dict) else (entry, "")
    if isinstance(entry, dict) and not report:
        for member in entry:
            if member not in ENTRY:
                raise UserError(
                    f"{path}: {name} has the member {member!r}; write {', '.join(ENTRY)}", argument="parameters"
                )
    if not isinstance(value, (int, float)):
        raise UserError(f"{path}: {name} is {value!r}, not a number", argument="parameters")
    known = loaded.variables.get(name)
    # Numbers without a unit, such as those of lobes, have the unit 1 in files.
    own = unit == "" or (unit == "1" and known is not None and known.unit is None)
    return in_own_unit(name, value if own else (value, unit), loaded, f"{path}: ")
