"""Motions of the two motors, the input of every simulation."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from prw.arguments import floats_of
from prw.columns import ANGLES, RATES
from prw.errors import UserError

Array = NDArray[np.float64]

#: Share of a turn by which a jump may differ from a turn, and least rate of the jump in rad/s, if an angle restarts after a full turn.
TURN, SUDDEN = 0.1, 30.0

#: Frequency (rad/s) and length (s) of the excitation behind Fig. 4 (Sec. 4).
FIG4_FREQUENCY = 10 * np.pi
FIG4_DURATION = 2.0


#: Largest absolute value of a time, s. Beyond a million years, samples of a controller would have equal times.
LATEST = 3e13


@dataclass(frozen=True)
class Motion:
    """Motor motion at the communication points.

    Angles that restart after a full turn, as at -pi and pi, are continued, and a note reports it.

    Parameters
    ----------
    time
        (n,) s, strictly increasing.
    theta
        (n, 2) rad, the motor angles theta1 and theta2.
    omega
        (n, 2) rad/s, their rates at the same instants, or None if only angles are known.
    name
        Name for files and titles.
    notes
        Notes for the user, for example on probable mistakes in the recording.

    Raises
    ------
    UserError
        A value is not a number, the shapes do not fit, or time does not increase.
    """

    time: Array
    theta: Array
    omega: Array | None = None
    name: str = "motion"
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        for name in ("time", "theta", "omega"):
            value = getattr(self, name)
            if value is None and name != "omega":
                raise UserError(f"motion: {name} is None; it must be an array")
            if value is not None:
                object.__setattr__(self, name, _numbers(name, value))
        count = len(self.time) if self.time.ndim == 1 else 0
        if count < 2:
            raise UserError(f"motion: time has the shape {self.time.shape}; it must be (n,), with at least two times")
        for name, value in (("theta", self.theta), ("omega", self.omega)):
            if value is not None and value.shape != (count, 2):
                raise UserError(
                    f"motion: {name} has the shape {value.shape}; it must be ({count}, 2), a column each motor"
                )
        if not (np.diff(self.time) > 0).all():
            raise UserError("motion: time must increase from sample to sample")
        if (latest := np.abs(self.time).max()) > LATEST:
            raise UserError(f"motion: time reaches {latest:g} s; it must be between -{LATEST:g} s and {LATEST:g} s")
        continued = [unwrapped(name, self.time, column) for name, column in zip(ANGLES, self.theta.T)]
        notes = [note for _, note in continued if note]
        if notes:
            object.__setattr__(self, "theta", np.column_stack([column for column, _ in continued]))
            object.__setattr__(self, "notes", [*self.notes, *notes])

    @property
    def columns(self) -> dict[str, Array]:
        """Time (s), motor angles (rad) and, if they are known, rates (rad/s), (n,) each by name."""
        rates = () if self.omega is None else zip(RATES, self.omega.T)
        return {"time": self.time, **dict(zip(ANGLES, self.theta.T)), **dict(rates)}


def fig4(step: float = 1e-3, opposite: bool = True) -> Motion:
    """The paper's experiment (Sec. 4, Fig. 4): theta1' = sin(10 pi t) = -theta2'.

    The angles are the integrals from zero, (1 - cos(10 pi t)) / (10 pi). Angles and rates are exact at each communication
    point, and the path between two points is second-order accurate in `step`.

    Parameters
    ----------
    step
        Time between samples, s.
    opposite
        If false, theta2' equals theta1'.

    Returns
    -------
    Motion
        The motors' angles and rates, from 0 to 2 s.
    """
    time: Array = np.arange(round(FIG4_DURATION / step) + 1, dtype=np.float64) * step
    # 1 - cos as 2 sin^2, which does not cancel near t = 0
    theta1 = 2 * np.sin(FIG4_FREQUENCY * time / 2) ** 2 / FIG4_FREQUENCY
    omega1 = np.sin(FIG4_FREQUENCY * time)
    sides = np.array([1, -1 if opposite else 1])
    return Motion(time, np.outer(theta1, sides), np.outer(omega1, sides), "fig4" if opposite else "fig4_equal")


def unwrapped(name: str, time: Array, angle: Array) -> tuple[Array, str]:
    """The angle (n,) rad at the times (n,) s without jumps by a full turn, and a note if there were any. NaN are skipped."""
    there = np.flatnonzero(np.isfinite(angle))
    # Values near the largest float overflow without a warning, because the FMU rejects them.
    with np.errstate(all="ignore"):
        jumps = np.diff(angle[there])
        sudden = np.abs(jumps) > SUDDEN * np.diff(time[there])
        wraps = sudden & (np.abs(np.abs(jumps) - 2 * np.pi) < TURN * 2 * np.pi)
        # Other sudden jumps show that the column does not contain a smooth angle.
        if wraps.sum() <= (sudden & ~wraps).sum():
            return angle, ""
        continued = angle.copy()
        continued[there[1:]] -= 2 * np.pi * np.cumsum(np.sign(jumps) * wraps)
    return (
        continued,
        f"{name} restarts after full turns, first after {time[there][:-1][wraps][0]:.6g} s; it was continued without the jumps",
    )


def _numbers(name: str, value: object) -> Array:
    if np.ma.is_masked(value):
        raise UserError(f"motion: {name} has masked values; fill or remove them")
    return floats_of(f"motion: {name}", value)
