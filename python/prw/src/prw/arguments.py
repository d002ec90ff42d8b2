"""Checks and conversions of arguments; each error names its argument."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prw.errors import UserError

#: A larger relative standard deviation is a mistake: percent instead of a fraction.
MOST_RELATIVE = 1.0
#: Rows of CSV, in memory.
Table = Mapping[str, Any]


def names_of(argument: str, given: str | Iterable[str]) -> tuple[str, ...]:
    """A name or several, as a tuple."""
    if isinstance(given, str):
        return (given,)
    if not isinstance(given, Iterable):
        raise UserError(f"{given!r} is neither a name nor several", argument=argument)
    return tuple(given)


def counted(argument: str, value: Any) -> int:
    """An integer of at least 1."""
    if not isinstance(value, Integral) or value < 1:
        raise UserError("at least 1 is needed", argument=argument, given=repr(value))
    return int(value)


def positive(argument: str, value: Any, name: str = "") -> float:
    """A finite number above 0; name: the parameter or channel that it belongs to."""
    if not isinstance(value, Real) or not 0 < float(value) < math.inf:
        raise UserError(f"{name} {value!r} is not a positive number".lstrip(), argument=argument)
    return float(value)


def spread_of(argument: str, name: str, given: Any, start: float) -> tuple[float, float]:
    """The central value of a parameter and its relative standard deviation. `given` is both, or only the deviation;
    then the central value is `start`."""
    value, relative = given if isinstance(given, Sequence) and len(given) == 2 else (start, given)
    value, relative = positive(argument, value, name), positive(argument, relative, name)
    if relative > MOST_RELATIVE:
        raise UserError(
            f"{name} has a standard deviation of {relative:.0%}; 100 % is the most, as a fraction 1", argument=argument
        )
    return value, relative


def is_path(given: Any) -> bool:
    """Whether the argument is a path."""
    return isinstance(given, (str, os.PathLike))


def is_table(given: Any) -> bool:
    """Whether the argument has columns by name, as a DataFrame or a dict of arrays has."""
    return not is_path(given) and (hasattr(given, "keys") or hasattr(given, "columns"))


def columns_of(table: Any) -> dict[str, Any]:
    """The columns of a DataFrame (of pandas, polars, ...) or a dict of arrays; a named index is the first."""
    names = table.keys() if hasattr(table, "keys") else table.columns
    index = getattr(getattr(table, "index", None), "name", None)
    first = {} if index is None or index in names else {str(index): table.index}
    return first | {str(name): table[name] for name in names}


def numbers_of(where: str, values: Any) -> NDArray[np.float64]:
    """A column (n,). Raises UserError that begins with `where`."""
    array = np.asarray(values)
    if array.dtype.kind in "mM":
        raise UserError(f"{where}: has dates or durations; write seconds as numbers")
    try:
        array = array.astype(np.float64)
    except (TypeError, ValueError) as error:
        raise UserError(f"{where}: is not made of numbers ({error})") from None
    if array.ndim != 1:
        raise UserError(f"{where}: has the shape {array.shape}; a column is (n,)")
    return array
