"""An experiment as the fit sees it: where the motors were, and what the FMU is stepped through to compare."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Mapping, Optional, Sequence, Tuple

import numpy as np
from scipy.sparse import csr_matrix

from prw.identify.measurements import Measurements
from prw.identify.model import Model
from prw.identify.path import Path, smooth
from prw.motion import Motion

#: The FMU follows a motor's tangent over a step, which raises a motion's amplitude by (2 pi f h)^2 / 6: at 0.125 ms by
#: 0.006 % at 25 Hz and by 0.1 % at 100 Hz.
LONGEST_STEP = 0.125e-3
#: The fit compares frequencies up to the highest at which a motor's motion is this much stronger than the noise of its
#: samples (power, averaged over neighbouring frequencies) and this much further.
CLEAR, FURTHER = 10.0, 1.15
NEIGHBOURS = 9
#: Draws of the noise that this is judged by.
DRAWS = 8
#: Times are even if none is off by more than this fraction of a step.
EVEN = 1e-3
#: More communication points than this are not made for one experiment.
MOST_POINTS = 4_000_000


@dataclass(frozen=True)
class Experiment:
    """name: of the experiment. time: (n,) s, when samples were taken. channels: what was measured. values:
    (n, len(channels)) in SI with NaN for nothing, or None where it is only planned. start, step: first communication
    point and step in s. theta, omega: (N, 2) rad, rad/s at the communication points. every: every how many of them
    there is a sample; or 0, and `between` (n, N) interpolates. band: the highest frequency in Hz at which the motors
    move more than the noise of their samples; the fit looks no further. paths: of the two motors, or None where they
    are known."""

    name: str
    time: np.ndarray
    channels: Tuple[str, ...]
    values: Optional[np.ndarray]
    start: float
    step: float
    theta: np.ndarray
    omega: np.ndarray
    every: int
    between: Optional[csr_matrix] = None
    band: float = np.inf
    paths: Optional[Tuple[Path, Path]] = None
    notes: Tuple[str, ...] = ()

    def bins(self) -> int:
        """Number of frequencies, from 0, of the samples' discrete Fourier transform that the band holds."""
        n, duration = len(self.time), self.time[-1] - self.time[0]
        if not np.isfinite(self.band):
            return n // 2 + 1
        return int(min(n // 2 + 1, max(np.ceil(self.band * duration * n / (n - 1)), 8)))

    def motion(self) -> Motion:
        """What the FMU is driven by."""
        return Motion(self.start + self.step * np.arange(len(self.theta)), self.theta, self.omega, self.name)

    def rest(self) -> np.ndarray:
        """The state (6,) of rest at the motors' first angles."""
        return np.concatenate([self.theta[0], self.theta[0], [0.0, 0.0]])

    def simulate(
        self, model: Model, values: Sequence[Mapping[str, float]], state: Optional[np.ndarray] = None
    ) -> np.ndarray:
        """The channels (m, n, len(channels)) with m sets of parameters, from the initial state (6,) or rest."""
        return self.follow(model, values, self.theta, self.omega, state)

    def follow(
        self,
        model: Model,
        values: Sequence[Mapping[str, float]],
        theta: np.ndarray,
        omega: np.ndarray,
        state: Optional[np.ndarray] = None,
    ) -> np.ndarray:
        """The same with the motors at other angles and rates (N, 2) at the communication points."""
        motion = replace(self.motion(), theta=theta, omega=omega)
        found = model.follow(motion, self.channels, values, max(self.every, 1), state)
        return found if self.every else np.stack([self.between @ table for table in found])

    def wander(self, random: np.random.Generator) -> tuple:
        """Angles and rates (N, 2) that the noise of the motors' samples pretends while the motors rest."""
        points = np.minimum(self.motion().time, self.time[-1])
        drawn = [path.wander(random) for path in self.paths]
        return (
            np.column_stack([path(points) for path in drawn]),
            np.column_stack([path.derivative()(points) for path in drawn]),
        )

    def transients(self, model: Model, values: Mapping[str, float]) -> np.ndarray:
        """What the initial state adds to the channels, (n, len(channels), 6), with one set of parameters."""
        time = self.motion().time
        if self.every:
            return model.transients(time[:: self.every], self.channels, values)
        table = model.transients(time, self.channels, values)
        return (self.between @ table.reshape(len(table), -1)).reshape(len(self.time), -1, 6)


def prepare(measured: Measurements, quantum: float = 0.0, longest_step: float = LONGEST_STEP) -> Experiment:
    """Find the motors' paths in `measured` and lay communication points on them, at most `longest_step` s apart.

    quantum: of the motor angles in rad, where it is known to be coarser than it looks."""
    time, omega = measured.time, measured.omega
    paths = tuple(smooth(time, measured.theta[:, i], None if omega is None else omega[:, i], quantum) for i in (0, 1))
    spacing = (time[-1] - time[0]) / (len(time) - 1)
    even = np.abs(time - (time[0] + spacing * np.arange(len(time)))).max() < EVEN * spacing
    if not even:
        spacing = float(np.median(np.diff(time)))
    divisions = max(1, int(np.ceil(spacing / longest_step - 1e-9)))
    step = spacing / divisions
    count = (len(time) - 1) * divisions + 1 if even else int(np.ceil((time[-1] - time[0]) / step - 1e-9)) + 1
    count = max(min(count, MOST_POINTS), 5)
    points = time[0] + step * np.arange(count)
    inside = np.minimum(points, time[-1])
    theta = np.column_stack([path.angle(inside) for path in paths])
    omega = np.column_stack([path.angle.derivative()(inside) for path in paths])
    return Experiment(
        measured.name,
        time,
        measured.channels,
        measured.values,
        float(time[0]),
        step,
        theta,
        omega,
        divisions if even else 0,
        None if even else _interpolation(points, time),
        max(_band(path, time, measured.omega is not None) for path in paths),
        paths,
        tuple(measured.notes),
    )


def _band(path: Path, time: np.ndarray, logged: bool) -> float:
    """The highest frequency in Hz at which the path moves clearly more than the noise of its samples, with a
    margin."""
    n = len(time)
    even = np.linspace(time[0], time[-1], n)
    frequency = np.fft.rfftfreq(n, even[1] - even[0])
    window = np.hanning(n)

    def power(spline) -> np.ndarray:
        rate = spline.derivative()(even)
        found = np.abs(np.fft.rfft((rate - rate.mean()) * window)) ** 2 / (window @ window)
        return np.convolve(found, np.ones(NEIGHBOURS) / NEIGHBOURS, mode="same")

    noise = (2 * np.pi * frequency * path.noise) ** 2
    if logged:
        noise = 1 / (1 / np.maximum(noise, 1e-300) + 1 / max(path.rate_noise, 1e-150) ** 2)
    # In a periodic motion an encoder's errors are not white, but lines at multiples of the motion's frequency. They
    # differ much from draw to draw, so the strongest counts; by half, which for white noise is less than its mean.
    random = np.random.default_rng(0)
    noise = np.maximum(noise, np.max([power(path.wander(random)) for _ in range(DRAWS)], axis=0) / 2)
    moving = power(path.angle)
    clear = np.flatnonzero(moving[1:] > CLEAR * noise[1:])
    return FURTHER * frequency[clear[-1] + 1] if len(clear) and moving.max() > 0 else 0.0


def planned(motion: Motion, channels: Sequence[str]) -> Experiment:
    """An experiment that is yet to be made: the motors' motion is known, evenly sampled, and the channels have no
    values."""
    step = float(np.diff(motion.time).mean())
    return Experiment(
        motion.name, motion.time, tuple(channels), None, float(motion.time[0]), step, motion.theta, motion.omega, 1
    )


def _interpolation(points: np.ndarray, time: np.ndarray) -> csr_matrix:
    """Cubic interpolation from even points (N,) to times (n,): a matrix (n, N) with four numbers a row."""
    step = points[1] - points[0]
    first = np.clip(np.floor((time - points[0]) / step).astype(int) - 1, 0, len(points) - 4)
    x = (time - points[0]) / step - first
    weights = np.empty((len(time), 4))
    for i in range(4):
        others = [j for j in range(4) if j != i]
        weights[:, i] = np.prod([(x - j) / (i - j) for j in others], axis=0)
    columns = first[:, None] + np.arange(4)
    rows = np.repeat(np.arange(len(time)), 4)
    return csr_matrix((weights.ravel(), (rows, columns.ravel())), shape=(len(time), len(points)))
