"""The kinds of distortions: what may distinguish a rig or its record from the FMU."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from prw.identification.rounding import rounded

#: Beginning of the names of decreases, and of increases.
FALL, RISE = "decrease", "increase"


class Kind(NamedTuple):
    """A kind of distortion, which is an argument of `identify`.

    Attributes
    ----------
    scale
        Typical size, the unit of the fit's unknown. A gain is estimated as its logarithm.
    places
        Where it may be, with the names for messages; without any, the places are the channels.
    unit, factor
        Unit for messages, and the factor from it to SI.
    belongs
        Whether it is a property of the rig, which the fit may include without a request.
    positive
        Whether it is never negative.
    """

    scale: float
    places: Mapping[str, str] = {}
    unit: str = ""
    factor: float = 1.0
    belongs: bool = False
    positive: bool = False

    def worded(self, name: str, value: float, error: float) -> tuple[str, str]:
        """The name of a distortion of this kind and its size in words; a negative decrease is an increase. value, error: SI."""
        if value < 0 and name.startswith(FALL):
            name, value = RISE + name.removeprefix(FALL), -value
        return name, f"{' +- '.join(rounded(value / self.factor, error / self.factor))} {self.unit}".rstrip()


#: The kinds of distortions by argument.
KINDS = {
    "delay": Kind(1e-3, unit="ms", factor=1e-3),
    "lag": Kind(1e-3, unit="ms", factor=1e-3),
    "gain": Kind(1.0),
    "friction": Kind(
        1e-2,
        {
            "shafts": "friction in both input shafts",
            "output": "friction about pitch and roll",
            "shaft1": "friction in input shaft 1",
            "shaft2": "friction in input shaft 2",
            "motor1": "friction at motor 1",
            "motor2": "friction at motor 2",
        },
        "N.m",
        belongs=True,
        positive=True,
    ),
    "backlash": Kind(
        1e-3,
        {
            "k1": "backlash in the couplings k1",
            "k2": "backlash in the couplings k2",
            "motors": "backlash at the motors",
        },
        "mrad",
        1e-3,
        belongs=True,
        positive=True,
    ),
    "clearance": Kind(
        1e-3,
        {"k1": "clearance of the couplings k1", "k2": "clearance of the couplings k2"},
        "mrad",
        1e-3,
        belongs=True,
        positive=True,
    ),
    "cubic": Kind(
        100.0,
        {"k1": "cubic stiffness of the couplings k1", "k2": "cubic stiffness of the couplings k2"},
        "rad^-2",
        belongs=True,
    ),
    "asymmetry": Kind(
        1e-2,
        {name: f"excess of {name} on side 2 over side 1" for name in ("k1", "k2", "c1", "c2")},
        "%",
        1e-2,
        belongs=True,
    ),
    "viscous": Kind(
        1e-2,
        {
            "shafts": "viscous friction in both input shafts",
            "between": "viscous friction of both shafts between the couplings",
        },
        "N.m.s/rad",
        belongs=True,
        positive=True,
    ),
    # Only on request, because the data of a jump, which has another value at the beginning, fit an even decrease, too.
    "softening": Kind(
        1e-2,
        {name: f"{FALL} of {name} over the recording" for name in ("k1", "k2")},
        "%",
        1e-2,
    ),
    "turned": Kind(
        1e-2, {"imu": "turn of the inertial sensor from pitch towards roll"}, "deg", math.pi / 180, belongs=True
    ),
    "fading": Kind(1e-2, unit="%", factor=1e-2),
    "crosstalk": Kind(
        1e-2,
        {
            "torques": "crosstalk between tau1 and tau2",
            "tau1": "crosstalk from tau2 to tau1",
            "tau2": "crosstalk from tau1 to tau2",
        },
        "%",
        1e-2,
    ),
}
#: Kinds that filter a channel, and kinds that change the linear model; the others add to the outputs.
FILTERS = ("delay", "lag", "gain")
LINEAR = ("asymmetry", "viscous")
