"""Motor motions for identification, ranked by the expected standard errors: `prw.excite`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from prw.arguments import Given, check_names, names_of, positive, values_of
from prw.columns import MEASURED
from prw.errors import UserError, need
from prw.identification import DEFAULT_ESTIMATE, task_of
from prw.motion import Motion

#: Maximum number of samples, and minimum number of samples per second.
MAX_SAMPLES, MIN_RATE = 2_000_000, 50.0


class Excitation(NamedTuple):
    """A motion, and the expected result of one experiment with it.

    Attributes
    ----------
    motion
        The motion.
    typical_error
        Root mean square of the expected standard errors, as a fraction; infinite if a combination is undetermined.
    expected_errors
        Expected standard errors by parameter, as fractions.
    undetermined
        Combinations of parameters that the experiment does not determine.
    noise
        Assumed noise by channel, SI.
    """

    motion: Motion
    typical_error: float
    expected_errors: dict[str, float]
    undetermined: list[str]
    noise: dict[str, float]

    @property
    def name(self) -> str:
        """The motion's name: its kind and its pattern."""
        return self.motion.name


def excite(
    measure: str | Iterable[str] | None = None,
    *,
    angle: float = np.deg2rad(40.0),
    speed: float = np.deg2rad(450.0),
    acceleration: float = np.deg2rad(20000.0),
    duration: float = 10.0,
    rate: float = 1000.0,
    estimate: str | Iterable[str] = DEFAULT_ESTIMATE,
    parameters: Given = None,
    noise: Mapping[str, float] = {},
    fmu: str | os.PathLike[str] | None = None,
) -> list[Excitation]:
    """Motions within the motors' limits, in increasing order of the expected standard errors.

    Slow multisines, wide multisines and chirps, each with equal, opposite, single and independent motors, and one multisine
    whose spectrum is optimal for the parameters.

    Parameters
    ----------
    measure
        Channels that will be measured (default: all).
    angle, speed, acceleration
        Limits of the motors, rad, rad/s, rad/s2.
    duration
        Duration of a motion, s.
    rate
        Samples per second.
    estimate, parameters, noise, fmu
        As for `prw.identify`.

    Returns
    -------
    list of Excitation
        The motions with their expected standard errors, the best one first.

    Raises
    ------
    UserError
        A name is not known, or a number is out of range.
    """
    need("scipy", "threadpoolctl")
    from threadpoolctl import threadpool_limits

    from prw.identification import design
    from prw.identification.experiment import planned
    from prw.identification.model import Model
    from prw.identification.statistics import covariance_of, undetermined

    limits = design.Limits(
        *(positive(*each) for each in (("angle", angle), ("speed", speed), ("acceleration", acceleration)))
    )
    duration, rate = positive("duration", duration), positive("rate", rate)
    channels = tuple(MEASURED) if measure is None else names_of("measure", measure)
    check_names("measure", channels, MEASURED)
    check_names("noise", noise, channels)
    if not channels:
        raise UserError(f"nothing is named; there are {', '.join(MEASURED)}", argument="measure")
    if not 4 * design.FADE <= duration <= MAX_SAMPLES / rate:
        least = f"it must be {4 * design.FADE:g} s or more, and at most 2 million samples"
        raise UserError(least, argument="duration", given=f"{duration:g}")
    if rate < MIN_RATE:
        reason = "the testbed moves at up to 30 Hz; sample with 50 Hz or more"
        raise UserError(reason, argument="rate", given=f"{rate:g}")
    ranking = []
    with Model(fmu) as model, threadpool_limits(1):
        given = values_of(parameters, model.loaded)
        task = task_of(model.known, estimate, parameters=given, noise=noise)
        known = {**design.DEFAULT_NOISE, **noise}
        assumed = {name: known[name] for name in channels}
        for motion in design.motions(model, task, limits, duration, rate, assumed):
            found = design.information(model, [planned(motion, channels)], task, task.first(), assumed)
            errors = dict(zip(task.names, np.sqrt(np.diag(covariance_of(found))).tolist()))
            left = [str(combination) for combination in undetermined(task.names, found)]
            ranking.append(Excitation(motion, design.typical_error(found), errors, left, assumed))
    # Motions that leave a combination undetermined are ordered by the geometric mean of the parameters' errors.
    return sorted(ranking, key=lambda e: (e.typical_error, float(np.mean(np.log(list(e.expected_errors.values()))))))
