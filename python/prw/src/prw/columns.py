"""The channels that can be measured on the testbed, their units, and the headers of recordings."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import pi
from pathlib import Path
from typing import NamedTuple

from prw.errors import UserError, one_line

#: Factor to SI of every unit that a column may have, by quantity. The first unit of each quantity is the SI unit.
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "arcmin": pi / 10800, "rev": 2 * pi},
    "rate": {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": pi / 180, "rev/s": 2 * pi, "rpm": pi / 30},
    "torque": {"N.m": 1.0, "mN.m": 1e-3, "N.cm": 1e-2, "N.mm": 1e-3, "kN.m": 1e3},
}
#: Other spellings of units.
ALIASES = {
    "sec": "s",
    "µs": "us",
    "°": "deg",
    "degree": "deg",
    "degrees": "deg",
    "turn": "rev",
    "turns": "rev",
    "°/s": "deg/s",
    "deg_s": "deg/s",
    "dps": "deg/s",
    "rad_s": "rad/s",
}


class Channel(NamedTuple):
    """A measured output.

    Attributes
    ----------
    quantity
        A key of UNITS.
    noise
        Standard deviation in SI that is assumed before anything is measured: 0.1 % of the range of a 20 N.m torque
        sensor; 0.06 deg and 0.6 deg/s for an encoder or inertial sensor.
    """

    quantity: str
    noise: float


MEASURED: dict[str, Channel] = {
    "tau1": Channel("torque", 0.02),
    "tau2": Channel("torque", 0.02),
    "theta3": Channel("angle", 1e-3),
    "theta4": Channel("angle", 1e-3),
    "pitch": Channel("angle", 1e-3),
    "roll": Channel("angle", 1e-3),
    "pitch_rate": Channel("rate", 1e-2),
    "roll_rate": Channel("rate", 1e-2),
}
#: The outputs that can be measured.
CHANNELS = tuple(MEASURED)
MOTORS = {"theta1": "angle", "theta2": "angle", "omega1": "rate", "omega2": "rate"}
#: The quantity of every column that is understood.
QUANTITIES = {"time": "time", **MOTORS, **{name: channel.quantity for name, channel in MEASURED.items()}}


def factor(name: str, unit: str) -> float:
    """The factor from `unit` to SI for column `name`. A unit may be divided, as in rev/10000 for the counts of an
    encoder. Raises UserError for an unknown unit or a unit of another quantity."""
    whole, slash, count = unit.partition("/")
    # Other characters, such as ², are digits for Python, too, but not numbers.
    if slash and count.strip().isdecimal() and int(count) > 0:
        return factor(name, whole) / int(count)
    known = UNITS[QUANTITIES[name]]
    spelt = unit.strip().replace("·", ".").replace("*", ".").replace(" ", ".")
    spelt = ALIASES.get(spelt, spelt)
    for spelling, value in known.items():
        if spelt in (spelling, spelling.replace(".", "")):
            return value
    raise UserError(f"{name} cannot be in {unit!r}; use {', '.join(known)}")


def si_unit(name: str) -> str:
    """The SI unit of column `name`."""
    return next(iter(UNITS[QUANTITIES[name]]))


ANGLES = ("theta1", "theta2")
RATES = ("omega1", "omega2")
#: Header of a column: `pitch [deg]`, `pitch (deg)`, `pitch_deg`, `pitch/deg` or `pitch deg`. Case does not
#: matter, and `t` is the time.
NAMES = "|".join(sorted([*QUANTITIES, "t"], key=len, reverse=True))
COLUMN = re.compile(rf"^\s*({NAMES})(?:\s*\[([^\]]*)\]|\s*\(([^)]*)\)|[\s_/,]+(\S+))?\s*$", re.IGNORECASE)
#: Maximum number of column names quoted in an error message.
SHOWN = 12


class Columns(NamedTuple):
    """The columns to read from a table.

    Attributes
    ----------
    taken
        (name, index) of each column, the time first.
    units
        Unit by name.
    assumed
        The columns whose unit is neither in the header nor given.
    notes
        Notes for the user, for example on ignored columns.
    """

    taken: list[tuple[str, int]]
    units: dict[str, str]
    assumed: set[str]
    notes: list[str]


def columns(
    path: Path,
    header: Sequence[str],
    line: int,
    outputs: Sequence[str] = (),
    units: Mapping[str, str] | None = None,
    degrees: bool | None = None,
) -> Columns:
    """Find time, both angles, both rates if present, and those `outputs` (names of measured outputs) that are present.

    A column's unit is in its header (`pitch [deg]`) or in `units` by name; without either it is SI, or degrees and
    degrees per second if `degrees`. If `degrees` is None, SI is only assumed. Raises UserError that names file, row and column. line: row of the header, or 0 for
    a table in memory.
    """
    where = f"{path}, row {line}" if line else str(path)
    wanted = ("time", *MOTORS, *outputs)
    found: dict[str, int] = {}
    chosen: dict[str, str] = {}
    assumed = set()
    ignored = []
    for index, title in enumerate(header):
        name, unit = column(title)
        if name not in wanted:
            ignored.append(title or "(blank)")
            continue
        if name in found:
            raise UserError(f"{where}, column {name}: appears twice in the header")
        found[name] = index
        try:
            given = (units or {}).get(name, "")
            chosen[name] = unit_of(name, unit, given, bool(degrees))
            if degrees is None and not unit and not given:
                assumed.add(name)
        except UserError as error:
            raise UserError(f"{where}, column {name}: {error}") from None
    if not found:
        is_number = [re.fullmatch(r"\s*[-+]?[\d.]+(?:e[-+]?\d+)?\s*", title, re.IGNORECASE) for title in header]
        what = "there is no header" if all(is_number) else "this is not a table of motor angles"
        has = f"the row has {shown(header)}" if header else "it has none"
        hint = "; separate columns by comma, semicolon or tab" if len(header) == 1 and "theta1" in header[0] else ""
        raise UserError(f"{where}: {what}; it must have the columns time, theta1, theta2, but {has}{hint}")
    for name in ("time", *ANGLES):
        if name not in found:
            hint = "; separate columns by comma, semicolon or tab" if line and len(header) == 1 else ""
            raise UserError(f"{where}: column {name} is missing; the header has {shown(header)}{hint}")
    if (RATES[0] in found) != (RATES[1] in found):
        missing = RATES[1] if RATES[0] in found else RATES[0]
        raise UserError(f"{where}: column {missing} is missing; give both {' and '.join(RATES)}, or neither")
    notes = [f"columns ignored: {', '.join(ignored)}"] if ignored else []
    return Columns([(name, found[name]) for name in wanted if name in found], chosen, assumed, notes)


def shown(header: Sequence[str]) -> str:
    """The first names of the header, for an error message."""
    return ", ".join(one_line(title, 40) or "(blank)" for title in header[:SHOWN]) + (
        ", ..." if len(header) > SHOWN else ""
    )


def column(title: str) -> tuple[str, str]:
    """The name in QUANTITIES and the unit of the column title; both "" if it is unknown."""
    match = COLUMN.match(title)
    if not match:
        return "", ""
    name = "time" if match.group(1).lower() == "t" else match.group(1).lower()
    if match.group(4):
        # pitch_deg is pitch in deg, but pitch_wanted is another column
        try:
            factor(name, match.group(4))
        except UserError:
            return "", ""
    return name, next(filter(None, match.groups()[1:]), "").strip()


def unit_of(name: str, in_header: str, given: str, degrees: bool = False) -> str:
    """The unit of column `name`: the one in its header, the one that is `given`, or the default. Raises UserError if the first two
    differ, or for a unit of another quantity."""
    if in_header and given and factor(name, in_header) != factor(name, given):
        raise UserError(f"the header has the unit {in_header}, but `units` has {given}")
    default = si_unit(name)
    if degrees and QUANTITIES[name] in ("angle", "rate"):
        default = default.replace("rad", "deg")
    unit = in_header or given or default
    factor(name, unit)  # raises UserError for a unit of another quantity
    return unit
