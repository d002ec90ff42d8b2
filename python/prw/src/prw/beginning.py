"""Effect of motors that turn already at the first sample on a simulation, which begins at rest."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from prw.motion import Array, Motion

#: The rates at the first sample are estimated from this number of samples, and count as motion above this number of standard errors.
FIT, CLEAR = 8, 5.0
#: Seconds for which motors are assumed to have turned at a constant rate, or as in the recording, before its first sample.
UNIFORM, REFLECTED = 10.0, 2.0
#: Factor on the errors, because the true motion before the recording may differ from the assumed ones. It was found with sines.
MARGIN = 1.5
#: Error as a fraction of an output's peak from which on it matters, and a peak below which an output is a rounding error.
MATTERS, ROUNDING = 0.01, 1e-12


class Beginning(NamedTuple):
    """The effect of motors that turn already at the first sample.

    Attributes
    ----------
    rates
        Rates of the motors at the first sample, rad/s.
    output, error
        The output whose error due to the unknown motion before the first sample is the largest, as a fraction of its peak.
    lasts
        Seconds from the first sample until the errors of all outputs remain below 1 % of their peaks.
    """

    rates: tuple[float, float]
    output: str
    error: float
    lasts: float

    def __str__(self) -> str:
        side = int(np.argmax(np.abs(self.rates)))
        return (
            f"the recording begins in motion (theta{side + 1} turns at {self.rates[side]:.3g} rad/s), but the simulation begins at rest, so "
            f"in the first {self.lasts:.2g} s {self.output} may be off by {self.error:.0%} of its peak; begin the recording at rest, or "
            "leave out these results"
        )


def beginning(
    motion: Motion, found: Mapping[str, Array], respond: Callable[[Motion], dict[str, Array]]
) -> Beginning | None:
    """The effect on the outputs `found`, (n,) by name; None if it is small. respond: simulates a motion from rest.

    The motion before the recording is not known, so the outputs are compared with two runs that have one: at constant rates, and as the
    recording continues, but in the opposite direction of time and angle, with which angles and rates are continuous, too.
    """
    rates = _first_rates(motion)
    if not rates.any():
        return None
    worst, output, until = 0.0, "", motion.time[0]
    for earlier in (_uniform(motion, rates), _reflected(motion)):
        count = len(earlier.time) - len(motion.time)
        for name, values in respond(earlier).items():
            if (peak := float(np.abs(found[name]).max())) < ROUNDING:
                continue
            error = MARGIN * np.abs(values[count:] - found[name]) / peak
            if error.max() > worst:
                worst, output = float(error.max()), name
            until = motion.time[error > MATTERS].max(initial=until)
    if worst <= MATTERS:
        return None
    return Beginning((float(rates[0]), float(rates[1])), output, worst, float(until - motion.time[0]))


def _first_rates(motion: Motion) -> Array:
    """Rates of the motors (2,) at the first sample, rad/s; 0 if they are not larger than the noise of the angles makes them."""
    if motion.omega is not None:
        given: Array = motion.omega[0]
        return given
    time = motion.time[:FIT] - motion.time[0]
    powers = np.vander(time / time[-1], 3, increasing=True)
    found, *_ = np.linalg.lstsq(powers, motion.theta[:FIT] - motion.theta[0], rcond=None)
    residual = motion.theta[:FIT] - motion.theta[0] - powers @ found
    variance = np.sum(residual**2, axis=0) / max(len(time) - 3, 1) * np.linalg.inv(powers.T @ powers)[1, 1]
    clear: Array = np.where(np.abs(found[1]) > CLEAR * np.sqrt(variance), found[1] / time[-1], 0.0)
    return clear


def _uniform(motion: Motion, rates: Array) -> Motion:
    """The motion after motors that turn at constant rates. The last steps are as long as the first step of the motion, because the FMU
    estimates rates from several samples."""
    step = motion.time[1] - motion.time[0]
    before = np.concatenate([np.linspace(-UNIFORM - 4 * step, -4 * step, 100), np.arange(-3, 0) * step])
    return _preceded(motion, before, motion.theta[0] + np.outer(before, rates), np.tile(rates, (len(before), 1)))


def _reflected(motion: Motion) -> Motion:
    """The motion after the motion that a point reflection at the first sample makes from its beginning."""
    before = motion.time[0] - motion.time[1:]
    before = before[-before <= REFLECTED][::-1]
    part = slice(len(before), 0, -1)
    omega = motion.theta if motion.omega is None else motion.omega
    return _preceded(motion, before, 2 * motion.theta[0] - motion.theta[part], omega[part])


def _preceded(motion: Motion, before: Array, theta: Array, omega: Array) -> Motion:
    """The motion after another one, at the times `before` relative to its beginning."""
    return Motion(
        np.concatenate([motion.time[0] + before, motion.time]),
        np.vstack([theta, motion.theta]),
        None if motion.omega is None else np.vstack([omega, motion.omega]),
    )
