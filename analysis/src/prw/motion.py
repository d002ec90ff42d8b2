"""Motions of the two motors: what every simulation starts from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Optional

import numpy as np

#: Frequency and length of the excitation behind Fig. 4 (Sec. 4).
FIG4_FREQUENCY = 10 * np.pi
FIG4_DURATION = 2.0


@dataclass(frozen=True)
class Motion:
    """Motor motion at the communication points.

    name: what files and titles are called after. time: (n,) s, strictly increasing. theta: (n, 2) rad, motor angles
    theta1, theta2. omega: (n, 2) rad/s, their rates at the same instants, or None where only angles are known.
    notes: lines the user should read.
    """

    name: str
    time: np.ndarray
    theta: np.ndarray
    omega: Optional[np.ndarray] = None
    notes: list = field(default_factory=list)


def fig4(step: float = 1e-3, opposite: bool = True) -> Motion:
    """The paper's experiment (Sec. 4, Fig. 4), sampled every `step` seconds: theta1' = sin(10 pi t) = -theta2'.
    With `opposite` false its counterpart, in which theta2' equals theta1'.

    The angles are the integrals from zero, (1 - cos(10 pi t)) / (10 pi). Angle and rate are both the true values at the
    communication point: the torque there is then the true one, and the path in between is second-order accurate.
    """
    time = np.arange(round(FIG4_DURATION / step) + 1) * step
    # 1 - cos as 2 sin^2, which does not cancel near t = 0
    theta1 = 2 * np.sin(FIG4_FREQUENCY * time / 2) ** 2 / FIG4_FREQUENCY
    omega1 = np.sin(FIG4_FREQUENCY * time)
    sides = np.array([1, -1 if opposite else 1])
    return Motion("fig4" if opposite else "fig4_equal", time, np.outer(theta1, sides), np.outer(omega1, sides))
