"""Prepares an experiment for the fit: spectra of the motors' paths, of the measurements, and of the errors of both.

The fit compares discrete Fourier transforms of the whole recording, up to the frequency at which the motors' motion
is lost in the noise of their samples. Transforms are unitary: white noise of variance v has the power v at every
frequency.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.sparse import csr_matrix, diags

from prw.columns import MEASURED, si_unit
from prw.errors import UserError
from prw.identification.path import Path, quantum_of, rough_noise, smooth
from prw.motion import Array, Motion
from prw.recording import Recording
from prw.state_space import Complex

#: The fit ends at the highest frequency at which the power of a motor's motion, averaged over NEIGHBOURS frequencies,
#: is CLEARLY_MOVING times the noise of its samples; MARGIN multiplies that frequency.
CLEARLY_MOVING, MARGIN = 10.0, 1.15
NEIGHBOURS = 9
#: Share of the greatest power below which power is a rounding error.
ROUNDING = 1e-10
#: FINEST: least relative error of a spectral line, because doubles, digits in CSV files and the linear model are not
#: exact. LEAST: least error of a value in SI.
FINEST, LEAST = 1e-7, 1e-15
#: A channel is constant if its range is at most this fraction of its default noise.
STILL = 1e-6
#: Motion of the motors between the rows of a recording. "motors": smooth. The others are for a simulation of the FMU in
#: Co-Simulation with a step from row to row: "inputs" if the motors' rates were inputs, "angles" if the FMU estimated
#: them from the angles.
Rates = Literal["motors", "inputs", "angles"]
#: Fractions of a motor's range. If the noise is at most EXACT and the quantum at most DIGITS, a recording may come from
#: a simulation. The samples of a simulation are used without smoothing if the noise is at most ROUNDED.
EXACT, DIGITS, ROUNDED = 1e-3, 1e-4, 1e-6
#: DRAWS: number of draws of the encoders' errors. FURTHEST: number of neighbouring frequencies into which a spectral
#: line of these errors leaks.
DRAWS, FURTHEST = 64, 100
#: Largest deviation of even times, as a fraction of a step.
EVEN = 1e-3
#: Largest difference of the frequency of hum from its nominal value, Hz; range around it, Hz, with whose power the hum is compared; and
#: least ratio of both, which white noise exceeds in one of 10 000 recordings.
SEARCHED, AROUND, HUM = 0.5, 8.0, 15.0
#: Largest number of frequencies on each side whose power is compared.
NEARBY = 50
#: Minimum numbers of compared frequencies, and of values from which a channel's noise is estimated.
MIN_FREQUENCIES, MIN_VALUES = 8, 20


@dataclass(frozen=True)
class Experiment:
    """A measured or planned experiment with n times, s samples and c channels.

    Attributes
    ----------
    name
        Name of the experiment.
    time
        (n,) s, evenly spaced.
    theta, omega
        (n, 2), angles (rad) and rates (rad/s) of the motors at `time`.
    channels
        Names of the measured outputs.
    sampled
        (s,) s, times of the samples.
    bins
        Number of compared frequencies, from 0.
    motor_errors
        (d, bins, 2) rad, spectra of d draws of the errors of the motors' samples.
    channel_errors
        (d, bins, c), spectra of d draws of the channels' errors that are caused by the steps of encoders.
    values
        (s, c) in SI, NaN if missing; None if the experiment is planned.
    between
        (s, n), interpolation from `time` to `sampled`, or None if both are equal.
    samplers
        Interpolation of each channel, with empty rows at missing values; None if no value is missing and `between` is None.
    paths
        Paths of the two motors through the recorded samples, or None if the experiment is planned.
    notes
        Notes for the user, for example on channels that never change.
    jumps
        (n, 2) rad, if the FMU simulated the recording, else None: the difference of each angle from its extrapolation
        with the rate, which makes the FMU's states jump at the start of the next step.
    limited
        Whether values far from the model were limited, see `outliers`.
    """

    name: str
    time: Array
    theta: Array
    omega: Array
    channels: tuple[str, ...]
    sampled: Array
    bins: int
    motor_errors: Complex
    channel_errors: Complex
    values: Array | None = None
    between: csr_matrix | None = None
    samplers: tuple[csr_matrix, ...] | None = None
    paths: tuple[Path, Path] | None = None
    notes: tuple[str, ...] = ()
    jumps: Array | None = None
    limited: bool = False

    @property
    def step(self) -> float:
        """Time between two points of `time`, s."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    @property
    def all_bins(self) -> int:
        """Number of all frequencies."""
        return len(self.time) // 2 + 1

    @property
    def needed_bins(self) -> int:
        """Number of frequencies at which the model is needed: all if values are missing or rows are uneven, because both mix
        frequencies."""
        return self.bins if self.samplers is None else self.all_bins

    @property
    def band(self) -> float:
        """The highest frequency that is compared, Hz."""
        return (self.bins - 1) / (len(self.time) * self.step)

    @cached_property
    def motors(self) -> Complex:
        """Spectra of the motors' angles and rates (all_bins, 4), and of `jumps` (all_bins, 6) if there are any."""
        return spectra(np.hstack([self.theta, self.omega, *([] if self.jumps is None else [self.jumps])]))

    @cached_property
    def finest(self) -> Array:
        """Lower bound (c,) of the channels' noise, SI: the error of the numbers and of the path between samples."""
        turn = 2 * np.pi * np.arange(1, self.bins) / len(self.time)
        # Twelve times the error of a cubic between two samples, or 72 times if the rows are uneven.
        between = turn**4 * (0.0 if self.jumps is not None else 1 / 60 if self.between is None else 1 / 10)
        found: Array = np.max((FINEST + between)[:, None] * np.abs(self.measured[1:]), axis=0, initial=LEAST)
        return found

    @cached_property
    def measured(self) -> Complex:
        """Spectra of the measurements (bins, c)."""
        assert self.values is not None
        if self.samplers is None:
            return spectra(self.values)[: self.bins]
        known = np.nan_to_num(self.values)
        signals = np.column_stack([s.T @ column for s, column in zip(self.samplers, known.T)])
        return spectra(signals)[: self.bins]

    @cached_property
    def shares(self) -> Array:
        """(c,), sum of the squares of each sampler's weights per point of `time`, which is the share of points that
        have a value."""
        if self.samplers is None:
            return np.ones(len(self.channels))
        return np.array([s.power(2).sum() / len(self.time) for s in self.samplers])

    @cached_property
    def motor_power(self) -> Array:
        """Power (bins, 2) rad2 of the errors of the motors' samples."""
        return _power(self.motor_errors)

    @cached_property
    def channel_power(self) -> Array:
        """Power (bins, c) of the channels' errors that are caused by the steps of encoders."""
        return _power(self.channel_errors)

    def observed(self, modelled: Complex) -> Complex:
        """Spectra (bins, c, ...) as in `measured`, from a model's spectra (needed_bins, c, ...)."""
        if self.samplers is None:
            return modelled
        signals = np.fft.irfft(modelled, len(self.time), axis=0, norm="ortho")
        flat = signals.reshape(len(self.time), len(self.channels), -1)
        for i, sampler in enumerate(self.samplers):
            flat[:, i] = sampler.T @ (sampler @ flat[:, i])
        return spectra(flat.reshape(signals.shape))[: self.bins]

    def signals(self, modelled: Complex) -> Array:
        """The channels (s, c) at `sampled` of spectra (all_bins, c)."""
        found = np.fft.irfft(modelled, len(self.time), axis=0, norm="ortho")
        return found if self.between is None else np.asarray(self.between @ found)


def spectra(signals: Array) -> Complex:
    """The unitary Fourier transform over the first axis, frequencies from 0."""
    return np.fft.rfft(signals, axis=0, norm="ortho")


def prepare(
    recording: Recording,
    quantum: float = 0.0,
    rates_of: Rates = "motors",
    exact: bool = False,
    hum: Mapping[str, float] = {},
) -> Experiment:
    """Find the motors' paths in `recording`, and the errors of their samples and of the other encoders.

    quantum: of the motor angles in rad, if it is coarser than the data suggest. rates_of: see `Rates`. exact: the
    samples are the motors' angles and rates. hum: frequencies in Hz by channel, which is subtracted if the motors do not move the channel
    there. Raises UserError if a channel has too few values or no channel is measured."""
    sampled, omega = recording.time, recording.omega
    channels, values, notes = _measured(recording)
    paths = [smooth(sampled, recording.theta[:, i], None if omega is None else omega[:, i], quantum) for i in (0, 1)]
    spacing = (sampled[-1] - sampled[0]) / (len(sampled) - 1)
    even = np.abs(sampled - (sampled[0] + spacing * np.arange(len(sampled)))).max() < EVEN * spacing
    if even:
        time = sampled[0] + spacing * np.arange(len(sampled))
    else:
        spacing = float(np.median(np.diff(sampled)))
        time = sampled[0] + spacing * np.arange(max(int((sampled[-1] - sampled[0]) / spacing + 1e-9) + 1, 5))
    inside = np.clip(time, sampled[0], sampled[-1])
    theta = np.column_stack([path.angle(inside) for path in paths])
    rates = np.column_stack([path.angle.derivative()(inside) for path in paths])
    errors = [_drawn(path, inside, sampled) for path in paths]
    jumps = None
    if rates_of != "motors" and even:
        if exact or all(path.noise <= ROUNDED * max(np.ptp(path.quiet), LEAST) for path in paths):
            theta, rates = recording.theta, rates if omega is None else omega
            errors = [np.zeros((1, len(time)))] * 2
        if rates_of == "angles":
            rates = _estimated(theta, spacing)
        notes += ("it is taken for a simulation of the FMU, with a step from row to row",)
        jumps = np.vstack([np.zeros((1, 2)), theta[1:] - theta[:-1] - spacing * rates[:-1]])
    bins = max(_clear(t, e, path.rate_noise, spacing) for t, e, path in zip(theta.T, errors, paths))
    bins = min(max(bins, MIN_FREQUENCIES), len(time) // 2 + 1)
    for name, frequency in hum.items():
        if name in channels and frequency - SEARCHED > (bins - 1) / (len(time) * spacing):
            i = channels.index(name)
            values[:, i], note = _without_hum(
                sampled, values[:, i], name, frequency, (bins - 1) / (len(time) * spacing)
            )
            notes += (note,)
    channel_errors = np.stack([errors_of_steps(sampled, column, inside, bins) for column in values.T], axis=2)
    between = None if even else _interpolation(time, sampled)
    motor_errors = np.stack([_with_rates(e, p.rate_noise, spacing)[:, :bins] for e, p in zip(errors, paths)], axis=2)
    return Experiment(
        *(recording.name, time, theta, rates, channels, sampled, bins, motor_errors, channel_errors),
        values=values,
        between=between,
        samplers=_samplers(between, values),
        paths=(paths[0], paths[1]),
        notes=notes,
        jumps=jumps,
    )


def _without_hum(time: Array, column: Array, name: str, frequency: float, band: float) -> tuple[Array, str]:
    """A channel (n,) without the hum at a frequency near `frequency`, Hz, and a note. The mains are not exact, so the hum is where the channel
    has the most power within SEARCHED. The window suppresses the motion, which has other frequencies. Without hum, nothing changes. band: highest
    frequency of the motion, Hz."""
    there = np.isfinite(column)
    known, values = time[there], column[there]
    window = np.hanning(len(values))
    windowed = (values - values.mean()) * window

    def amplitude(at: float) -> complex:
        return complex(2 / window.sum() * (np.exp(-2j * np.pi * at * known) @ windowed))

    # A peak is as wide as the inverse of the duration.
    spacing = min(SEARCHED, 1 / float(known[-1] - known[0])) / 4
    trials = np.arange(frequency - SEARCHED, frequency + SEARCHED, spacing)
    best = float(max(trials, key=lambda at: abs(amplitude(at))))
    span = best - spacing, best + spacing
    exact = float(
        minimize_scalar(lambda at: -abs(amplitude(at)), bounds=span, method="bounded", options={"xatol": 1e-6}).x
    )
    size = amplitude(exact)
    away = np.arange(2 * SEARCHED, AROUND, max(4 * spacing, AROUND / NEARBY))
    around = [at for by in away for at in (frequency - by, frequency + by) if at > band]
    near = [abs(amplitude(at)) ** 2 for at in around]
    # The median of the power of noise, which has an exponential distribution, is not changed by other lines.
    if abs(size) ** 2 < HUM * float(np.median(near)) / np.log(2):
        return column, f"no hum of {name} is found near {frequency:g} Hz, so nothing is subtracted"
    note = f"hum of {name} of {exact:.5g} Hz with an amplitude of {abs(size):.2g} {si_unit(name)} is subtracted"
    return column - (size * np.exp(2j * np.pi * exact * time)).real, note


def errors_of_steps(sampled: Array, column: Array, time: Array, bins: int) -> Complex:
    """Spectra (DRAWS, bins) at `time` (n,) of the errors that the steps of an encoder cause in a channel (s,) at the times `sampled`; 0 if it
    has none, or more of other noise."""
    there = np.isfinite(column)
    if not _stepped(column[there]):
        return np.zeros((DRAWS, bins), dtype=np.complex128)
    drawn = _drawn(smooth(sampled[there], column[there]), time, sampled[there])
    found: Complex = spectra(drawn.T)[:bins].T
    return found


def may_be_simulated(experiment: Experiment) -> bool:
    """Whether the motors' samples are evenly spaced and so exact that they may come from a simulation."""
    paths = experiment.paths or ()
    exact = [
        path.noise <= EXACT * reach and path.quantum <= DIGITS * reach
        for path in paths
        for reach in [max(float(np.ptp(path.quiet)), LEAST)]
    ]
    return all(exact) and experiment.between is None and experiment.jumps is None


def _estimated(theta: Array, step: float) -> Array:
    """The rates (n, 2) that the FMU estimates from the angles (n, 2): a backward difference of second order, of first order in the
    second row, 0 in the first."""
    rates = np.zeros_like(theta)
    rates[1:2] = (theta[1:2] - theta[:1]) / step
    rates[2:] = (1.5 * theta[2:] - 2 * theta[1:-1] + 0.5 * theta[:-2]) / step
    return rates


def _measured(recording: Recording) -> tuple[tuple[str, ...], Array, tuple[str, ...]]:
    """The channels that change, their values (s, c), and notes for the user. Raises UserError if a channel has too few values, or
    none changes."""
    if not recording.measured:
        raise UserError(
            f"{recording.source}: nothing measured; at least one column of {', '.join(MEASURED)} is needed, "
            f"the file has {', '.join(recording.units)}"
        )
    # Rates are found by smoothing here, so the notes for simulations on rates do not apply.
    notes = [note for note in recording.notes if "at rest" not in note and not note.startswith("no omega")]
    moving = {}
    for name, column in recording.measured.items():
        count = int(np.isfinite(column).sum())
        if count < MIN_VALUES:
            raise UserError(
                f"{recording.source}, column {name}: {count} values; at least {MIN_VALUES} are needed to fit anything"
            )
        if np.nanmax(column) - np.nanmin(column) > STILL * MEASURED[name].noise:
            moving[name] = column
        else:
            notes.append(f"{name} never changes and is left out; if it should, is its sensor connected?")
    if not moving:
        raise UserError(f"{recording.source}: nothing that was measured changes; is the testbed at rest?")
    return tuple(moving), np.column_stack(list(moving.values())), tuple(notes)


def planned(motion: Motion, channels: Sequence[str]) -> Experiment:
    """A planned experiment: the motors' motion is known and evenly sampled, and the channels have no values."""
    assert motion.omega is not None
    step = float(motion.time[-1] - motion.time[0]) / (len(motion.time) - 1)
    exact = np.zeros((1, len(motion.time)))
    bins = max(MIN_FREQUENCIES, *(_clear(theta, exact, None, step) for theta in motion.theta.T))
    bins = min(bins, len(motion.time) // 2 + 1)
    known, none = (np.zeros((1, bins, count), dtype=np.complex128) for count in (2, len(channels)))
    motors = motion.name, motion.time, motion.theta, motion.omega
    return Experiment(*motors, tuple(channels), motion.time, bins, known, none)


def _drawn(path: Path, time: Array, sampled: Array) -> Array:
    """Draws (DRAWS, n) of the errors of the samples at the times `sampled`, interpolated to the times (n,)."""
    random = np.random.default_rng(0)
    return np.array([np.interp(time, sampled, path.errors(random)) for _ in range(DRAWS)])


def _power(errors: Complex) -> Array:
    """Mean power (bins, ...) of the spectra (d, bins, ...) of draws."""
    mean: Array = np.mean(np.abs(errors) ** 2, axis=0)
    # In a periodic motion, the spectrum of the errors consists of lines. The leakage of a line is correlated with the
    # line, even if the leakage is small, so each frequency gets at least the leakage of a line between two frequencies.
    leaked = 1 / (np.pi * np.arange(1, FURTHEST + 1)) ** 2
    spread = [np.convolve(column, [*leaked[::-1], 0.0, *leaked])[FURTHEST:-FURTHEST] for column in mean.T]
    power: Array = np.maximum(mean, np.column_stack(spread))
    return power


def _with_rates(errors: Array, rate_noise: float | None, step: float) -> Complex:
    """Spectra (d, f) of draws (d, n) of an angle's errors. The spectra are smaller if the rate was logged, with noise of the
    standard deviation rate_noise."""
    found = spectra(errors.T).T
    if rate_noise is None:
        return found
    w = 2 * np.pi * np.arange(found.shape[1]) / (errors.shape[1] * step)
    power = np.mean(np.abs(found) ** 2, axis=0)
    together: Complex = found / np.sqrt(1 + power * (w / max(rate_noise, 1e-150)) ** 2)
    return together


def _clear(theta: Array, errors: Array, rate_noise: float | None, step: float) -> int:
    """Number of frequencies, from 0, up to the highest one at which the angle theta (n,) moves clearly more than its
    errors. errors: (d, n), draws of the errors."""
    n = len(theta)
    window = np.hanning(n - 1)

    def power(signal: Array) -> Array:
        increments = np.diff(signal) / step
        found = np.abs(np.fft.rfft((increments - increments.mean()) * window)) ** 2 / (window @ window)
        return np.convolve(found, np.ones(NEIGHBOURS) / NEIGHBOURS, mode="same")

    # In a periodic motion, the spectrum of an encoder's errors consists of lines at multiples of the motion's
    # frequency, which differ much between draws. So at least half of the strongest draw counts; for white noise this is
    # less than the mean.
    drawn = [power(signal) for signal in errors]
    noise = np.maximum(np.mean(drawn, axis=0), np.max(drawn, axis=0) / 2)
    if rate_noise is not None:
        noise = 1 / (1 / np.maximum(noise, 1e-300) + 1 / max(rate_noise, 1e-150) ** 2)
    moving = power(theta)
    noise = np.maximum(noise, ROUNDING * moving.max())
    clear = np.flatnonzero(moving[1:] > CLEARLY_MOVING * noise[1:])
    return int(np.ceil(MARGIN * (clear[-1] + 1))) + 1 if len(clear) and moving.max() > 0 else 0


def _stepped(values: Array) -> bool:
    """Whether values (n,) have steps that are larger than other noise."""
    quantum = quantum_of(values)
    return quantum > 0 and rough_noise(values) < quantum


def _samplers(between: csr_matrix | None, values: Array) -> tuple[csr_matrix, ...] | None:
    """The field `samplers` of an Experiment."""
    if between is None and np.isfinite(values).all():
        return None
    keep = [csr_matrix(diags(np.isfinite(column).astype(float))) for column in values.T]
    return tuple(keep if between is None else [(k @ between).tocsr() for k in keep])


def _interpolation(points: Array, time: Array) -> csr_matrix:
    """Cubic interpolation from even points (n,) to times (s,): a matrix (s, n) with four numbers a row."""
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
