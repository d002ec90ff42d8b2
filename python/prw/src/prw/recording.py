"""Reads a recorded experiment. prw.plausibility finds probable mistakes in it."""

from __future__ import annotations

import os
import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from prw.arguments import Table, check_names, columns_of, counted, flag, is_path, is_table, numbers_of
from prw.columns import ANGLES, MEASURED, QUANTITIES, RATES, Columns, columns, factor, shown
from prw.errors import UserError
from prw.motion import Array, Motion, unwrapped
from prw.plausibility import notes_on_gaps, notes_on_values
from prw.table import Choice, read_table

#: Name of a recording that is not read from a file.
IN_MEMORY = Path("recording")


@dataclass(frozen=True)
class Recording:
    """One recorded experiment, in SI. `recording[name]` is a column (n,): the time, a motor or a measured output.

    Attributes
    ----------
    motion
        The motion of the motors.
    measured
        The measured values, (n,), of each recorded output; NaN where a cell is empty.
    units
        The unit of each column in the file.
    source
        The file, or a name if there is none.
    """

    source: Path
    motion: Motion
    measured: Mapping[str, Array]
    units: Mapping[str, str]

    @property
    def name(self) -> str:
        """The file's name without suffix."""
        return self.motion.name

    @property
    def time(self) -> Array:
        """(n,) s."""
        return self.motion.time

    @property
    def theta(self) -> Array:
        """(n, 2) rad: theta1, theta2."""
        return self.motion.theta

    @property
    def omega(self) -> Array | None:
        """(n, 2) rad/s: omega1, omega2; None if they were not recorded."""
        return self.motion.omega

    @property
    def notes(self) -> list[str]:
        """Notes for the user, for example on probable mistakes in the recording."""
        return self.motion.notes

    def __getitem__(self, column: str) -> Array:
        columns = {**self.motion.columns, **self.measured}
        if column not in columns:
            raise KeyError(f"{column}: was not recorded; there are {', '.join(columns)}")
        return columns[column]

    def __repr__(self) -> str:
        span = f"{self.time[0]:g} to {self.time[-1]:g} s"
        return f"<Recording {self.name}: {', '.join(self.units)}; {len(self.time)} times, {span}>"


def read(
    path: str | os.PathLike[str] | Table,
    units: Mapping[str, str] | None = None,
    degrees: bool | None = None,
    *,
    names: Mapping[str, str] = {},
    skip: int = 0,
    encoding: str = "",
) -> Recording:
    """Read a recorded experiment from a CSV file, or from a DataFrame or a dict of arrays with the same columns.

    The columns are time (s), theta1, theta2 (rad) and, if present, omega1, omega2 (rad/s) and any of tau1, tau2 (N.m), theta3,
    theta4, pitch, roll (rad), pitch_rate, roll_rate (rad/s), in any order; other columns are ignored. Time may be uneven but must
    increase. If rows are missing, a note reports it; if they are missing for too long while the motors move, the recording is
    rejected. A measured column may have empty cells.

    By default, a file is UTF-8 text, or UTF-16 with a byte order mark. It has a header line, which may follow comments that begin
    with `#`. Columns are separated by commas, semicolons or tabs; with semicolons, numbers may have a decimal comma.

    Parameters
    ----------
    path
        The file or table.
    units
        Unit by column of the file, if the header has none (`pitch [deg]` has one). Default: SI. If an encoder has 10000
        counts per revolution, the unit of its counts is `rev/10000`.
    degrees
        Whether columns without a unit are in degrees and degrees per second, or in rad and rad/s. By default they are in rad
        and rad/s, but a recording whose motors would then move implausibly fast or far is rejected.
    names
        Names of columns in the file, if they differ: {"theta1": "Motor 1"}.
    skip
        Number of lines above the header; dSPACE writes such lines.
    encoding
        Encoding of the file, as in Python. Default: UTF-8, or UTF-16 if the file begins with the byte order mark of UTF-16.

    Raises
    ------
    UserError
        The recording cannot be read; the message names file, row and column.
    """
    found = read_columns(path, units, degrees, tuple(MEASURED), names, skip, encoding)
    check_units(units, [found])
    return found


def read_motion(
    path: str | os.PathLike[str] | Table,
    units: Mapping[str, str] | None = None,
    degrees: bool | None = None,
    *,
    names: Mapping[str, str] = {},
    skip: int = 0,
    encoding: str = "",
) -> Motion:
    """Read only the motors' motion, as `read` does; other columns are ignored."""
    return read_columns(path, units, degrees, (), names, skip, encoding).motion


def check_units(units: Mapping[str, str] | None, recordings: Sequence[Recording]) -> None:
    """Raise UserError if a column with a unit in `units` is in none of the recordings."""
    for name in units or {}:
        if not any(name in each.units for each in recordings):
            files = ", ".join(str(each.source) for each in recordings)
            there = dict.fromkeys(name for each in recordings for name in each.units)
            raise UserError(f"{files}: no column {name}, whose unit is given; there are {', '.join(there)}")


def read_columns(
    source: str | os.PathLike[str] | Table,
    units: Mapping[str, str] | None,
    degrees: bool | None,
    measured: tuple[str, ...],
    names: Mapping[str, str],
    skip: int,
    encoding: str,
) -> Recording:
    """Read the motion and the columns `measured`, as `read` does; `units` may have names of other columns."""
    if not is_path(source) and not is_table(source):
        raise UserError(f"{source!r} is not a recording: neither a file nor a DataFrame or a dict of arrays")
    path = Path(source) if isinstance(source, (str, os.PathLike)) else IN_MEMORY
    check_names("units", units or {}, QUANTITIES)
    check_names("names", names, QUANTITIES)
    called = {header: name for name, header in names.items()}
    if len(called) < len(names):
        raise UserError(f"{names!r} names one column twice", argument="names")
    counted("skip", skip, 0)
    if degrees is not None:
        degrees = flag("degrees", degrees)
    if is_table(source) and (skip or encoding):
        raise UserError("belongs to a file; this is a table in memory", argument="skip" if skip else "encoding")

    found = Columns([], {}, set(), [])

    def choose(header: Sequence[str], line: int) -> Sequence[tuple[str, int]]:
        nonlocal found
        where = f"{path}, row {line}" if line else str(path)
        for name in called:
            if not any(_is_called(title, name) for title in header):
                raise UserError(f"{where}: no column {name!r}; the header has {shown(header)}")
        found = columns(path, [_renamed(title, called) for title in header], line, measured, units, degrees)
        return found.taken

    values = (
        _gathered(source, choose, may_be_empty=measured)
        if is_table(source)
        else read_table(path, choose, measured, True, skip, encoding)
    )
    table = {name: values[:, i] * factor(name, found.units[name]) for i, (name, _) in enumerate(found.taken)}
    time = table.pop("time")
    theta = np.column_stack([table.pop(name) for name in ANGLES])
    omega = np.column_stack([table.pop(name) for name in RATES]) if RATES[0] in table else None
    # Angles near the largest float overflow without a warning, because the FMU rejects them.
    with np.errstate(all="ignore"):
        motion = Motion(time, theta, omega, path.stem, found.notes)
        for name in table:
            table[name], note = unwrapped(name, time, table[name]) if QUANTITIES[name] == "angle" else (table[name], "")
            motion.notes.extend([note] if note else [])
        motion.notes.extend(notes_on_gaps(path, time, motion.theta))
        motion.notes.extend(notes_on_values(path, time, motion.theta, omega, found))
    return Recording(path, motion, table, found.units)


def _gathered(table: Any, choose: Choice, may_be_empty: Container[str]) -> Array:
    """Reads and checks columns in memory, as `read_table` does for a file."""
    columns = columns_of(table)
    taken = choose(list(columns), 0)
    found: list[Array] = []
    values = list(columns.values())
    for name, index in taken:
        column = numbers_of(f"{IN_MEMORY}, column {name}", values[index])
        if found and len(column) != len(found[0]):
            raise UserError(f"{IN_MEMORY}, column {name}: has {len(column)} rows, but time has {len(found[0])}")
        bad = ~np.isfinite(column) if name not in may_be_empty else np.isinf(column)
        if bad.any():
            first = int(bad.argmax())
            masked = isinstance(values[index], np.ma.MaskedArray) and np.ma.getmaskarray(values[index])[first]
            why = "masked" if masked else "not finite"
            raise UserError(f"{IN_MEMORY}, column {name}: {column[first]} at index {first} is {why}")
        found.append(column)
    if len(found[0]) < 2:
        raise UserError(f"{IN_MEMORY}: has {len(found[0])} rows; at least two are needed")
    if not (np.diff(found[0]) > 0).all():
        raise UserError(f"{IN_MEMORY}, column time: time must increase from row to row")
    return np.column_stack(found)


def _is_called(title: str, name: str) -> bool:
    """Whether a column title consists of the name and, perhaps, a unit."""
    return re.fullmatch(re.escape(name) + r"\s*([\[(].*[\])])?", title) is not None


def _renamed(title: str, names: Mapping[str, str]) -> str:
    """The column title with its name replaced as in `names`; a unit after the name is kept."""
    name = max((n for n in names if _is_called(title, n)), key=len, default="")
    return names[name] + title.removeprefix(name) if name else title
