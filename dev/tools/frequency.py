"""Frequency responses: measured on the FMU by stepped sines, for comparison with its linear model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from prw.motion import Array, Motion
from prw.testbed import Testbed

#: The shafts' angles q of H(s), eq. (15), and the sensors' torques.
SHAFTS = ("theta3", "theta4", "theta5", "theta6")
TORQUES = ("tau1", "tau2")

#: Minimum number of steps in a period. A motor follows its tangent over a step, which raises the amplitude of its motion by the
#: fraction (2 pi / STEPS)^2 / 6: 0.0014 dB.
STEPS = 200
#: The longest step, s. At low frequencies it must be short: the torques, and the angles of the shafts on the side of the motor
#: at rest, are small differences of large angles.
LONGEST_STEP = 2e-3
#: Number of evaluated periods.
PERIODS = 2
#: The evaluation begins when transients have decreased to this fraction.
SETTLED = 1e-7


def sweep(fmu: Path, frequency: ArrayLike, slowest: float, outputs: Sequence[str] = (*SHAFTS, *TORQUES)) -> np.ndarray:
    """Measure the frequency response of the Co-Simulation FMU: one motor at a time moves as theta = sin(2 pi f t).

    frequency: (k,) Hz. slowest: decay rate of the slowest transient, 1/s. After it has settled, the component of each
    output at f over whole periods (one bin of its discrete Fourier transform) is divided by the component of the motor's angle.
    Returns the response, complex (k, outputs, 2 motors), in the output's unit per rad.
    """
    frequencies = np.atleast_1d(np.asarray(frequency, dtype=float))
    response = np.empty((len(frequencies), len(outputs), 2), dtype=complex)
    for k, f in enumerate(frequencies):
        periods = int(np.ceil(-np.log(SETTLED) / slowest * f))
        steps = max(STEPS, int(np.ceil(1 / (LONGEST_STEP * f))))
        n = (periods + PERIODS) * steps
        time = np.arange(n) / (steps * f)
        phase = 2 * np.pi * (np.arange(n) % steps) / steps
        window = slice(periods * steps, n)
        bin_of = np.exp(-1j * phase[window])
        for motor in range(2):
            theta, omega = np.zeros((n, 2)), np.zeros((n, 2))
            theta[:, motor], omega[:, motor] = np.sin(phase), 2 * np.pi * f * np.cos(phase)
            with Testbed(fmu) as testbed:
                found = testbed.respond(Motion(time, theta, omega), outputs)
            drive = bin_of @ theta[window, motor]
            response[k, :, motor] = [bin_of @ found[name][window] / drive for name in outputs]
    return response


def decibels(response: ArrayLike) -> Array:
    """20 log10 |response|."""
    return np.asarray(20 * np.log10(np.abs(response)))


def degrees(response: ArrayLike) -> Array:
    """The phase in degrees, unwrapped along the frequencies, which are on the first axis."""
    return np.asarray(np.rad2deg(np.unwrap(np.angle(np.asarray(response)), axis=0)))
