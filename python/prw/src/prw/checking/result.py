"""Tables of results as other tools write them: CSV, OpenModelica's .mat, MATLAB's .mat."""

from __future__ import annotations

import math
import os
import re
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from prw.arguments import check_names
from prw.columns import NAMES, QUANTITIES, column, factor, shown, unit_of
from prw.errors import UserError, need
from prw.motion import Array
from prw.table import read_table

#: The title of a column: the components, which end with dots in Modelica and SSP and with slashes in Simulink, then the name.
PREFIXED = re.compile(rf"^(.*[./:|])?((?:{NAMES}|tout).*)$", re.IGNORECASE)
#: The component and the first word of any title.
TITLE = re.compile(r"^(.*[./:|])?(\w+)")
#: Maximum memory of the values in a .mat file, in bytes.
LARGEST = 256 << 20
#: Bytes of a value in memory, by the name of the type in `scipy.io.whosmat`; 8 for all others. An element of a cell array or of an
#: array of structures is a Python object.
_BYTES = {"single": 4, "int32": 4, "uint32": 4, "int16": 2, "uint16": 2, "int8": 1, "uint8": 1, "logical": 1, "char": 4}
_BYTES |= {"cell": 1000, "struct": 1000}
#: Types of elements in a .mat file of format 5, and classes of arrays.
ARRAY, COMPRESSED = 14, 15
CELLS, STRUCTURES, OBJECTS, SPARSE = 1, 2, 3, 5
#: The default component if columns of several components have the same name.
TESTBED = "testbed"


@dataclass(frozen=True)
class Result:
    """The result of another tool, in SI.

    Attributes
    ----------
    source
        File of the result.
    time
        (n,) s, increasing.
    values
        (n,) by name in `prw.columns.QUANTITIES`.
    unknown
        Names of the other columns of the same components.
    owners
        The component of each of `values` whose title has one.
    """

    source: Path
    time: Array
    values: Mapping[str, Array]
    unknown: tuple[str, ...] = ()
    owners: Mapping[str, str] = field(default_factory=dict)


def read_result(path: Path, units: Mapping[str, str], component: str | None) -> Result:
    """Read the columns of time, motors and outputs; see `prw.check`. If several rows have the same time, the last one
    counts, because only there do inputs and outputs belong together. Raises UserError naming the file and the cause."""
    check_names("units", units, QUANTITIES)
    if not path.is_file():
        raise UserError(f"{path}: no such file")
    columns = _mat(path) if path.suffix.lower() == ".mat" else _csv(path)
    chosen, owners = _choose(path, columns, units, component)
    if "time" not in chosen:
        raise UserError(f"{path}: there is no column time; it has {shown(list(columns))}")
    time = chosen.pop("time")
    if not chosen:
        raise UserError(f"{path}: there is none of {', '.join(QUANTITIES)}; it has {shown(list(columns))}")
    table = np.column_stack([time, *chosen.values()])
    if not np.isfinite(table).all():
        row = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])
        raise UserError(f"{path}: row {row + 1} below the header contains a number that is not finite")
    if (np.diff(time) < 0).any():
        raise UserError(f"{path}: time runs backwards after {time[np.argmax(np.diff(time) < 0)]:g} s")
    last = np.append(np.diff(time) > 0, True)
    values = {name: column[last] for name, column in chosen.items()}
    return Result(path, time[last], values, tuple(_unknown(columns)), owners)


def _unknown(titles: Collection[str]) -> Iterator[str]:
    """Names of the columns that are not known, of the components that have known ones."""
    owners = {owner for owner, name, _ in map(_known, titles) if name not in ("", "time")}
    for title in titles:
        match = TITLE.match(title.strip())
        if match and (match[1] or "")[:-1] in owners and not _known(title)[1]:
            yield match[2]


def _choose(
    path: Path, columns: Mapping[str, Array], units: Mapping[str, str], component: str | None
) -> tuple[dict[str, Array], dict[str, str]]:
    """The known columns in SI, by their names in QUANTITIES, and their components. Raises UserError if the column or the component is
    unclear, a unit is wrong, or a unit is given for a column that does not exist."""
    candidates: dict[str, list[tuple[str, str, str]]] = {}
    for title in columns:
        owner, name, unit = _known(title)
        if name:
            candidates.setdefault(name, []).append((owner, title, unit))
    found, owners = {}, {}
    for name, same in candidates.items():
        wanted = [c for c in same if re.split(r"[./:|]", c[0])[-1].lower() == (component or TESTBED).lower()]
        if component is not None and name != "time":
            same = wanted
        elif len(same) > 1:
            same = wanted or same
        if not same:
            continue
        try:
            in_si = [columns[title] * factor(name, unit_of(name, unit, units.get(name, ""))) for _, title, unit in same]
        except UserError as error:
            raise UserError(f"{path}, column {name}: {error}") from None
        if not all(_equal(other, in_si[0]) for other in in_si):
            components = {owner or "none": None for owner, _, _ in same}
            if len(components) == 1:
                titles = ", ".join(title for _, title, _ in same)
                raise UserError(f"{path}: {titles} have different values of {name}; rename or remove all but one")
            raise UserError(
                f"there are several {name} in {path}, of the components {', '.join(components)}; name one",
                argument="component",
            )
        owners[name], found[name] = same[0][0], in_si[0]
    if component is not None and not set(found) - {"time"}:
        raise UserError(f"{path}: the component {component} has no known column; there are {shown(list(columns))}")
    for name in units:
        if name not in found:
            raise UserError(f"{path}: no column {name}, whose unit is given; there are {', '.join(found)}")
    return found, owners


def _equal(one: Array, other: Array) -> bool:
    """Whether two columns in SI have the same values, except for rounding errors of the conversion."""
    if one.shape != other.shape:
        return False
    return bool((np.abs(one - other) <= 1e-12 * np.abs(one).max(initial=0.0)).all())


def _known(title: str) -> tuple[str, str, str]:
    """The component, the name in QUANTITIES and the unit in the title of a column; the last two are "" if the name is unknown."""
    match = PREFIXED.match(title.strip())
    owner, name = (match[1] or "", match[2]) if match else ("", "")
    return owner[:-1], *column(re.sub(r"^tout\b", "time", name, flags=re.IGNORECASE))


def _csv(path: Path) -> dict[str, Array]:
    """The columns of a CSV file by title; the arrays of unknown columns are empty."""
    titles: list[str] = []
    taken: list[tuple[str, int]] = []

    def choose(header: Sequence[str], line: int) -> Sequence[tuple[str, int]]:
        titles.extend(header)
        taken.extend((title, index) for index, title in enumerate(header) if _known(title)[1])
        if not taken:
            raise UserError(f"{path}: there is no column time; it has {shown(header)}")
        return taken

    values = read_table(path, choose)
    columns = dict.fromkeys(titles, np.empty(0))
    for i, (title, _) in enumerate(taken):
        _add(path, columns, title, values[:, i])
    return columns


def _add(path: Path, columns: dict[str, Array], title: str, values: Array) -> None:
    """Add a column. Raises UserError if another column has the title of a known one."""
    if _known(title)[1] and len(columns.get(title, ())) and not np.array_equal(columns[title], values):
        raise UserError(f"{path}: two columns are called {title}; rename or remove one")
    columns[title] = values


def _mat(path: Path) -> dict[str, Array]:
    """The columns of a .mat file by title. Raises UserError if it cannot be read or contains no time."""
    need("scipy")
    from scipy.io import loadmat

    try:
        _check_size(path)
        content = loadmat(path, squeeze_me=True, struct_as_record=False, chars_as_strings=True)
        if "dataInfo" in content:
            return _modelica(path, loadmat(path, chars_as_strings=False))
    except UserError:
        raise
    except NotImplementedError:
        raise UserError(f"{path}: is of MATLAB's format 7.3; save it with: save('{path.name}', ..., '-v7')") from None
    # A malformed file can cause nearly any error in the reader.
    except Exception as error:
        raise UserError(f"{path}: cannot be read as a .mat file ({str(error) or type(error).__name__})") from None
    columns: dict[str, Array] = {}
    others: dict[str, str] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            for title, values in _of_variable(name, value):
                if values.ndim == 1 and len(values) > 1 and values.dtype.kind in "fiu":
                    _add(path, columns, title, values.astype(np.float64))
                else:
                    others[_known(title)[1]] = f"{title} is of type {values.dtype} and shape {values.shape}"
    there = {"", "time", *(_known(title)[1] for title in columns)}
    if unlike := [what for name, what in others.items() if name not in there]:
        raise UserError(f"{path}: {unlike[0]}; save it as a vector of real numbers")
    times = {name: len(values) for name, values in columns.items() if _is_time(name)}
    if not times:
        hint = "; save time and signals as vectors: save('run.mat', 'time', 'roll', ..., '-v7')"
        raise UserError(f"{path}: there is no vector time or tout; it has {shown(list(content))}{hint}")
    known = {name: len(values) for name, values in columns.items() if _known(name)[1]}
    lengths = {length for name, length in known.items() if name not in times} or {*times.values()}
    if len(lengths) > 1 or not lengths <= {*times.values()}:
        sizes = ", ".join(f"{name} {length}" for name, length in known.items())
        raise UserError(
            f"{path}: its columns have different numbers of values ({sizes}); save those of one recording only"
        )
    return {name: values for name, values in columns.items() if len(values) in lengths}


def _check_size(path: Path) -> None:
    """Raises UserError if the arrays of a .mat file take more memory than allowed: a file of a few bytes may declare or contain, in
    compressed form, arrays of any size, also within cells and structures."""
    from scipy.io import whosmat

    too_large = UserError(
        f"{path}: has more than {LARGEST >> 20} MB of values; save only time, motors and outputs, or fewer samples"
    )
    with open(path, "rb") as file:
        size, objects = os.fstat(file.fileno()).st_size, 0
        header = file.read(128)
        if header[126:128] == b"IM" and header[124:126] == b"\x00\x01":
            # Format 5: elements with the type and the number of bytes.
            size = 128
            while len(tag := file.read(8)) == 8:
                kind, length = np.frombuffer(tag, "<u4").tolist()
                if length > LARGEST:
                    raise too_large
                content = memoryview(tag + file.read(length))
                if kind == COMPRESSED:
                    inflate = zlib.decompressobj()
                    content = memoryview(inflate.decompress(content[8:], LARGEST + 1))
                size += len(content)
                if size > LARGEST:
                    raise too_large
                objects += _objects(content)
    values = sum(math.prod(shape) * _BYTES.get(kind, 8) for _, shape, kind in whosmat(path))
    # Values of small types are stored in less space than they take.
    if max(size, values, objects * _BYTES["cell"]) > LARGEST:
        raise too_large


def _objects(element: memoryview) -> int:
    """The number of elements of all cell arrays and arrays of structures in an array of format 5. Raises ValueError if an array
    declares more elements than the file contains bytes for them."""
    kind, length = np.frombuffer(element[:8], "<u4").tolist()
    if kind != ARRAY:
        return 0
    parts, at, found = [], 8, 0
    while at + 8 <= min(len(element), 8 + length):
        kind, size = np.frombuffer(element[at : at + 8], "<u4").tolist()
        # An element of at most four bytes has its size in the upper half of its type.
        small = kind >> 16 != 0
        content = element[at + 4 : at + 4 + (kind >> 16)] if small else element[at + 8 : at + 8 + size]
        parts.append((content, element[at : at + 8 + size]))
        at += 8 if small else 8 + size + -size % 8
    # The first three parts are the class, the shape and the name.
    of_class, shape = parts[0][0][0], np.frombuffer(parts[1][0], "<i4").astype(np.int64)
    count = math.prod(shape.tolist())
    if (shape < 0).any() or (count > length and of_class != SPARSE):
        raise ValueError(f"an array of {' x '.join(map(str, shape))} elements in {length} bytes")
    if of_class in (CELLS, STRUCTURES, OBJECTS):
        found = count + sum(_objects(whole) for _, whole in parts[3:])
    return found


def _is_time(title: str) -> bool:
    return title.rpartition(".")[2].lower() in ("time", "tout", "t")


def _of_variable(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    """The arrays in a variable of MATLAB, with their titles: a vector, a structure with vectors as fields, or a structure with time as
    Simulink logs it (`time`, and `signals` with a label and values each). Arrays that are not vectors of numbers are not columns."""
    if hasattr(value, "_fieldnames"):
        for field in value._fieldnames:
            inner = getattr(value, field)
            if field == "signals":
                for signal in np.atleast_1d(inner):
                    title = str(signal.label) if np.size(signal.label) else str(getattr(signal, "blockName", ""))
                    yield from _of_variable(title, signal.values)
            else:
                yield from _of_variable(f"{name}.{field}", inner)
        return
    yield name, np.asarray(value)


def _modelica(path: Path, content: Mapping[str, Any]) -> dict[str, Array]:
    """The trajectories in a file of OpenModelica or Dymola, by title. For each name, dataInfo contains the number N of
    the matrix data_N (0 for the time, which is in every matrix), and the column, which is negative if the sign must be
    changed. Variables that do not change are left out."""
    is_transposed = "".join(content["Aclass"][3]).strip().rstrip("\0") == "binTrans"

    def rows_of(name: str) -> Any:
        return content[name].T if is_transposed else content[name]

    titles = ["".join(row).rstrip("\0 ") for row in rows_of("name")]
    about = ["".join(row).rstrip("\0 ") for row in rows_of("description")]
    columns = {}
    for title, description, (table, index, *_) in zip(titles, about, rows_of("dataInfo")):
        data = rows_of(f"data_{table or 2}")
        if table == 1:  # does not change
            continue
        unit = re.search(r"\[([^\]|:#]+)[^\]]*\]\s*$", description)
        values = np.sign(index) * data[:, abs(int(index)) - 1].astype(np.float64)
        columns[f"{title} [{unit[1]}]" if unit else title] = values
    if not columns:
        raise UserError(f"{path}: there are no trajectories in it")
    return columns
