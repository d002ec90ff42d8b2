"""The channels that can be measured on the testbed, and their units."""

from __future__ import annotations

from math import pi
from typing import NamedTuple

from prw.errors import UserError

#: Factor to SI of every unit a column may have, by quantity. The first is SI.
UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": pi / 180, "arcmin": pi / 10800, "rev": 2 * pi},
    "rate": {"rad/s": 1.0, "mrad/s": 1e-3, "deg/s": pi / 180, "rev/s": 2 * pi, "rpm": pi / 30},
    "torque": {"N.m": 1.0, "mN.m": 1e-3, "N.cm": 1e-2, "N.mm": 1e-3, "kN.m": 1e3},
}
#: Other ways to write them.
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
    """A measured output. quantity: a key of UNITS. noise: the standard deviation assumed before anything is measured,
    in SI: a torque sensor of 20 N.m with 0.1 %, an encoder or inertial sensor of 0.06 deg and 0.6 deg/s."""

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
MOTORS = {"theta1": "angle", "theta2": "angle", "omega1": "rate", "omega2": "rate"}
#: The quantity of every column that is understood.
QUANTITIES = {"time": "time", **MOTORS, **{name: channel.quantity for name, channel in MEASURED.items()}}


def factor(name: str, unit: str) -> float:
    """The factor from `unit` to SI for column `name`. Raises UserError for a unit of another quantity. A unit may be divided, as in rev/10000 for the counts of an encoder."""
    whole, slash, count = unit.partition("/")
    if slash and count.strip().isdigit() and int(count) > 0:
        return factor(name, whole) / int(count)
    known = UNITS[QUANTITIES[name]]
    text = unit.strip().replace("·", ".").replace("*", ".").replace(" ", ".")
    text = ALIASES.get(text, text)
    for spelling, value in known.items():
        if text in (spelling, spelling.replace(".", "")):
            return value
    raise UserError(f"{name} cannot be in {unit!r}; use {', '.join(known)}")


def si_unit(name: str) -> str:
    """The SI unit of column `name`."""
    return next(iter(UNITS[QUANTITIES[name]]))
