"""The header of a recording: quantity and unit of each column."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from prw.channels import MOTORS, QUANTITIES, factor, si_unit
from prw.errors import UserError

ANGLES = ("theta1", "theta2")
RATES = ("omega1", "omega2")
#: `pitch [deg]`, `pitch (deg)`, or `pitch_deg`, `pitch/deg`, `pitch deg`; names in capitals or not, `t` for time
NAMES = "|".join(sorted([*QUANTITIES, "t"], key=len, reverse=True))
COLUMN = re.compile(rf"^\s*({NAMES})(?:\s*\[([^\]]*)\]|\s*\(([^)]*)\)|[\s_/,]+(\S+))?\s*$", re.IGNORECASE)
#: Maximum number of column names quoted in an error message.
SHOWN = 12


class Columns(NamedTuple):
    """taken: (name, index) of the columns to read, time first. units: unit by name. notes: lines for the user."""

    taken: list[tuple[str, int]]
    units: dict[str, str]
    notes: list[str]


def columns(
    path: Path,
    header: Sequence[str],
    line: int,
    outputs: Sequence[str] = (),
    units: Mapping[str, str] | None = None,
    degrees: bool = False,
) -> Columns:
    """Find time, both angles, both rates if present, and those `outputs` (names of measured outputs) that are present.

    A column's unit is in its header (`pitch [deg]`) or in `units` by name; without either it is SI, or degrees and
    degrees per second if `degrees`. Raises UserError naming file, row (`line`, 0 where there are none) and column.
    """
    where = f"{path}, row {line}" if line else str(path)
    wanted = ("time", *MOTORS, *outputs)
    found: dict[str, int] = {}
    chosen: dict[str, str] = {}
    ignored = []
    for index, text in enumerate(header):
        name, unit = column(text)
        if name not in wanted:
            ignored.append(text or "(blank)")
            continue
        if name in found:
            raise UserError(f"{where}, column {name}: appears twice in the header")
        found[name] = index
        try:
            chosen[name] = _unit(name, unit, (units or {}).get(name, ""), degrees)
        except UserError as error:
            raise UserError(f"{where}, column {name}: {error}") from None
    for name in ("time", *ANGLES):
        if name not in found:
            hint = "; separate columns by comma, semicolon or tab" if line and len(header) == 1 else ""
            raise UserError(f"{where}: column {name} is missing; the header has {shown(header)}{hint}")
    if (RATES[0] in found) != (RATES[1] in found):
        missing = RATES[1] if RATES[0] in found else RATES[0]
        raise UserError(f"{where}: column {missing} is missing; give both {' and '.join(RATES)}, or neither")
    notes = [f"columns ignored: {', '.join(ignored)}"] if ignored else []
    return Columns([(name, found[name]) for name in wanted if name in found], chosen, notes)


def shown(header: Sequence[str]) -> str:
    """The first names of the header, for an error message."""
    return ", ".join(text or "(blank)" for text in header[:SHOWN]) + (", ..." if len(header) > SHOWN else "")


def column(text: str) -> tuple[str, str]:
    """The name in QUANTITIES and the unit of the column title `text`; both "" if it is unknown."""
    match = COLUMN.match(text)
    if not match:
        return "", ""
    name = "time" if match.group(1).lower() == "t" else match.group(1).lower()
    if match.group(4):
        # pitch_deg is pitch in deg, but pitch_wanted is something else
        try:
            factor(name, match.group(4))
        except UserError:
            return "", ""
    return name, next(filter(None, match.groups()[1:]), "").strip()


def _unit(name: str, in_header: str, given: str, degrees: bool) -> str:
    if in_header and given and factor(name, in_header) != factor(name, given):
        raise UserError(f"in {in_header} by its header, but in {given} by the units given")
    default = si_unit(name)
    if degrees and QUANTITIES[name] in ("angle", "rate"):
        default = default.replace("rad", "deg")
    unit = in_header or given or default
    factor(name, unit)  # raises if it does not fit
    return unit
