"""Tests whether the model explains the data, and whether a fault would explain them.

The residuals of a correct fit are noise, which three tests check. Local regression over frequency
finds residuals that are coherent with the motors' spectra or the channel's own. Score tests (Rao, Proc. Cambridge Phil.
Soc. 44 (1948) 50) find the effects of single faults: a delay, a lag or a gain of one channel or of several, friction,
backlash. The third test compares the residuals' strength with the noise at frequencies at which the motors do not move.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from prw.identification.experiment import Experiment, spectra
from prw.identification.fit import Comparison, Solution
from prw.identification.response import Distortion
from prw.identification.statistics import MARGIN, covariance_of, information_of
from prw.motion import Array
from prw.state_space import Complex
from prw.testbed import OUTPUTS

#: Probability below which a coherence with the motion is a misfit. It is small, because the steps of encoders are not normally
#: distributed: in slow motion, probabilities of 1e-8 occur in correct fits.
CHANCE = 1e-10
#: Ratios of the size of a fault to its standard error. Above CLEAR the fault is significant, and above SMALL it widens
#: intervals. Friction always widens them, because every bearing has some.
CLEAR, SMALL = 4.7, 2.5
#: CLEAR for faults that follow the sign of a rate. It is larger, because in a periodic motion the steps of encoders
#: also follow that sign.
CLEAR_SIGN = 7.0
#: EXCESS: largest ratio of a channel's noise in the compared band to its noise above the band. LUCK: tolerance of this
#: ratio in standard errors.
EXCESS, LUCK = 1.3, 5.0
#: Frequencies per piece of the local regression, and maximum number of pieces.
PIECE, MAX_PIECES = 16, 6
#: Least ratio of the power of a moving signal to the power of encoders' errors in it.
CLEARLY_MOVING = 30.0
#: A direction is left out if less than this share of it is independent of the others.
NEW = 0.02
#: Share of a rate's greatest magnitude in which the sign of the rate changes smoothly, as the hyperbolic tangent.
TURNING = 0.02


#: Pairs of channels, which often share an amplifier or converter.
PAIRS = (("tau1", "tau2"), ("theta3", "theta4"), ("pitch", "roll"), ("pitch_rate", "roll_rate"))


def groups(solution: Solution, kind: str, channels: Sequence[str] = ()) -> list[tuple[str, ...]]:
    """Groups of channels (default: all) that may share a fault of a kind and have no distortion of this kind yet:
    single channels, pairs and, except for gains, all together."""
    channels, known = channels or solution.fitter.channels, set(solution.task.distortions)
    found: list[tuple[str, ...]] = [(name,) for name in channels]
    found += [pair for pair in PAIRS if set(pair) <= set(channels)]
    if len(channels) > 2 and kind != "gain":
        found.append(tuple(channels))
    return [group for group in found if not {Distortion(kind, name) for name in group} & known]


def named(kind: str, group: Sequence[str]) -> str:
    """The name of a fault that channels share."""
    return f"{kind} of {' and '.join(group) if len(group) < 3 else 'all channels'}"


class Fault(NamedTuple):
    """A possible fault.

    Attributes
    ----------
    name
        Name of the fault.
    unit
        Unit of its size.
    size, error
        Size, estimated together with the parameters, and its standard error.
    shift
        (p,), change of the unknowns that the fault would cause.
    per_error
        (p,), change of the unknowns by one standard error of the size.
    gain
        Rise of twice the log likelihood if the fault is included.
    """

    name: str
    unit: str
    size: float
    error: float
    shift: Array
    per_error: Array
    gain: float

    @property
    def signs(self) -> bool:
        """Whether the fault follows the sign of a rate."""
        return self.name.startswith(("friction", "backlash"))

    @property
    def clear(self) -> float:
        """Size in standard errors."""
        return abs(self.size) / self.error if self.error > 0 else 0.0

    @property
    def possible(self) -> bool:
        """Whether the size may be other than 0: neither friction nor backlash is ever negative."""
        return self.size > 0 or not self.signs

    @property
    def bias(self) -> Array:
        """Root mean square (p,) of the unknowns' errors that the fault causes, if its size is normally distributed
        about the estimate.

        It is not 0 even if the estimated size is 0, because the fault may then still have the size of its standard
        error. An interval that is widened by this contains the true value with at least its nominal probability,
        however large the fault is."""
        shift = self.shift if self.possible else np.zeros_like(self.shift)
        return np.hypot(shift, self.per_error)


class Misfit(NamedTuple):
    """An unexplained residual of a channel.

    Attributes
    ----------
    experiment, channel
        Names of both.
    low, high
        Frequencies between which most of the residual is, Hz.
    text
        Description.
    """

    experiment: str
    channel: str
    low: float
    high: float
    text: str

    def __str__(self) -> str:
        return f"{self.channel}: {self.text} ({self.low:.3g} to {self.high:.3g} Hz)"


class Verdict(NamedTuple):
    """Whether the model explains the data.

    Attributes
    ----------
    misfits
        Unexplained residuals; none if the model fits.
    faults
        The tested faults that are possible, in decreasing order of significance.
    widening
        (p,), standard deviations that are added in quadrature to the standard errors, because faults may be too small to be
        distinguished from chance.
    """

    misfits: tuple[Misfit, ...]
    faults: tuple[Fault, ...]
    widening: Array

    @property
    def suggested(self) -> Fault | None:
        """The most significant fault, if it is unlikely to be chance."""
        return next((fault for fault in self.faults if fault.clear > SMALL), None)

    @property
    def fits(self) -> bool:
        """Whether the model explains the data."""
        return not self.misfits


def judge(solution: Solution) -> Verdict:
    """Test the residuals of a fit."""
    inverse = covariance_of(solution.task.prior_information() + information_of(solution.jacobians))
    misfits: list[Misfit] = []
    faults: list[Fault] = []
    for i, (experiment, comparison) in enumerate(zip(solution.fitter.experiments, solution.comparisons)):

        def score(columns: Complex, i: int = i, comparison: Comparison = comparison) -> _Score:
            return _Score(solution, i, comparison.change_along(columns), inverse)

        spread, luck = _strength(solution, i)
        for j, name in enumerate(experiment.channels):
            there = score(_following(experiment, comparison, j))
            chance = there.chance(2 * experiment.bins)
            reasons = []
            if chance < CHANCE:
                reasons.append("the unexplained part follows the motors")
            if spread[j] > EXCESS * (1 + LUCK * luck[j]):
                reasons.append(
                    f"the residual is {float(f'{spread[j]:.2g}'):g} times the noise at frequencies at which the motors rest"
                )
            if reasons:
                misfits.append(Misfit(experiment.name, name, *_where(experiment, comparison, j), "; ".join(reasons)))
        for name, unit, column in single_faults(solution, experiment, comparison):
            fault = score(column[None]).fault(name, unit)
            if fault is not None:
                faults.append(fault)
    widening = np.zeros(len(inverse))
    for fault in faults:
        if fault.name.startswith("friction") or fault.clear > SMALL:
            widening = np.maximum(widening, fault.bias)
    faults = sorted((fault for fault in faults if fault.possible), key=lambda fault: -fault.clear)
    clear = [fault for fault in faults if fault.clear > (CLEAR_SIGN if fault.signs else CLEAR)]
    if clear and not misfits:
        fault = clear[0]
        e = solution.fitter.experiments[0]
        description = f"{fault.name} of {fault.size:.3g} +- {fault.error:.1g} {fault.unit}".rstrip()
        for channel in [name for name in e.channels if name in fault.name.split()] or ["all"]:
            misfits.append(Misfit(e.name, channel, 0.0, e.band, f"{description} would explain more of the data"))
    return Verdict(tuple(misfits), tuple(faults), widening)


class _Score:
    """The residuals' score along directions (2, bins, c, q) of one experiment."""

    def __init__(self, solution: Solution, i: int, table: Array, inverse: Array):
        flat = table.reshape(-1, table.shape[-1])
        size = np.sqrt(np.sum(flat**2, axis=0))
        self._size = np.where(size > 0, size, 1.0)
        flat = flat / self._size
        jacobian = solution.jacobians[i].reshape(len(flat), -1)
        self._shift = inverse @ (jacobian.T @ flat)
        rest = (flat - jacobian @ self._shift).reshape(table.shape)
        self._rest, self._residual = rest, solution.comparisons[i].residual
        self._score = flat.T @ solution.comparisons[i].residual.ravel()
        # Priors are measurements of the parameters, with errors.
        prior = self._shift.T @ solution.task.prior_information() @ self._shift
        self._variance = solution.comparisons[i].score_variance(rest) + prior
        self._information = flat.T @ rest.reshape(flat.shape)
        # Part of the Jacobian is noise, so the directions after its subtraction contain noise, too.
        self._noise = self._shift.T @ solution.noise_information @ self._shift
        for other, comparison in enumerate(solution.comparisons):
            if other != i:
                self._variance += comparison.score_variance(solution.jacobians[other] @ self._shift)

    def chance(self, count: int) -> float:
        """Probability of a score at least as large, along all directions, in a correct fit with noise estimated from `count`
        values."""
        values, vectors = np.linalg.eigh(self._information)
        whiten = vectors[:, values > NEW] / np.sqrt(values[values > NEW])
        k = whiten.shape[1]
        if not k:
            return 1.0
        # White residuals have the variance 1 in all directions. DRAWS of encoders' errors show larger
        # variances, but are too few to show smaller ones.
        variance, turn = np.linalg.eigh(whiten.T @ self._variance @ whiten)
        ratio = float(np.sum((turn.T @ whiten.T @ self._score) ** 2 / np.maximum(variance, 1.0)))
        left = max(count - ratio, 0.02 * count) / max(count - k, 1)
        return float(fdtrc(k, max(count - k, 1), ratio / k / left))

    def fault(self, name: str, unit: str) -> Fault | None:
        """The fault along the only direction; None if the parameters explain it as well."""
        left = float(self._information[0, 0])
        if left < max(1e-6, MARGIN * float(self._noise[0, 0])):
            return None
        size = float(self._score[0]) / left
        error = float(np.sqrt(self._variance[0, 0])) / left
        scale = self._size[0]
        after = self._residual - size * self._rest[..., 0]
        before, after = (np.sum(each**2, axis=(0, 1)) for each in (self._residual, after))
        gain = (
            2 * self._residual.shape[1] * float(np.sum(np.log(np.maximum(before, 1e-300) / np.maximum(after, 1e-300))))
        )
        shift = self._shift[:, 0]
        return Fault(name, unit, -size / scale, error / scale, shift * size, np.abs(shift) * error, gain)


def _following(experiment: Experiment, comparison: Comparison, j: int) -> Complex:
    """Columns (q, f, c), smooth over frequencies, that follow the motors and the channel itself in channel j. They are 0 at
    frequencies with large encoders' errors, because the residual contains the same errors."""
    bins, response = experiment.bins, comparison.response
    pieces = int(np.clip(bins // PIECE, 1, MAX_PIECES))
    position = np.linspace(0, pieces - 1 + 1e-9, bins)
    hats = np.maximum(0, 1 - np.abs(position - np.arange(pieces)[:, None]))
    own = response.outputs[:, j] + response.transients[:, j] @ comparison.initial
    motors = [(experiment.motors[:, i], np.eye(2)[i]) for i in (0, 1)]
    columns = []
    for signal, gains in [*motors, (own, response.transfer[:bins, j])]:
        errors = np.sum(np.abs(gains) ** 2 * experiment.motor_power, axis=1)
        clear = hats @ (np.abs(signal[:bins]) ** 2 - CLEARLY_MOVING * errors) > 0
        there = np.zeros((pieces, experiment.needed_bins, len(experiment.channels)), dtype=complex)
        there[clear, :bins, j] = hats[clear] * signal[:bins]
        columns += [there, 1j * there]
    return np.concatenate(columns)


def single_faults(
    solution: Solution, experiment: Experiment, comparison: Comparison
) -> Iterator[tuple[str, str, Complex]]:
    """Single faults: name, unit, and contribution to the channels (f, c) per unit."""
    response, count = comparison.response, experiment.needed_bins
    there = response.outputs + response.transients @ comparison.initial
    s: Complex = 2j * np.pi * np.arange(count, dtype=complex) / (len(experiment.time) * experiment.step)
    # A lag is the same as a delay to first order. A common fault of two channels may have ten standard errors, while each
    # single one has one or two, because the parameters compensate for the latter.
    for kind, unit in (("delay", "ms"), ("gain", "")):
        for group in groups(solution, kind, experiment.channels):
            indices = [experiment.channels.index(name) for name in group]
            column = np.zeros_like(there)
            column[:, indices] = Distortion(kind, group[0]).response(0.0, s)[1][:, None] * there[:, indices]
            yield named(kind, group), unit, column
    turning = [_sign(experiment.omega[:, i]) for i in (0, 1)]
    signs = spectra(np.column_stack(turning))[:count]
    yield "backlash at the motors", "rad", -(response.transfer @ signs[..., None])[..., 0] / 2
    for i, name in enumerate(("tau1", "tau2")):
        if name in experiment.channels:
            column = np.zeros_like(there)
            column[:, experiment.channels.index(name)] = signs[:, i]
            yield f"friction at motor {i + 1}", "N.m", column
    yield from _mechanical_friction(solution, experiment, comparison)


def _mechanical_friction(
    solution: Solution, experiment: Experiment, comparison: Comparison
) -> Iterator[tuple[str, str, Complex]]:
    """Dry friction of the output about pitch and roll, of both input shafts, and of each of them, in the form of
    `single_faults`."""
    model, known = solution.fitter.model.at(solution.values), solution.values
    turns = model.C[[OUTPUTS.index("pitch_rate"), OUTPUTS.index("roll_rate")]][:, 4:]
    inertia = known["J2"] * np.eye(2) + turns.T @ np.diag([known["H3"], known["J3"]]) @ turns
    states, through = comparison.response.moving(comparison.initial)
    count = experiment.needed_bins

    def braked(torques: Array) -> Complex:
        """Contribution of torques (n, 2) N.m against the motion of the input shafts."""
        accelerations = spectra(torques)[:count] @ np.linalg.inv(inertia)
        column: Complex = -experiment.step * (through[:, :, 4:] @ accelerations[..., None])[..., 0]
        return column

    shafts = np.fft.irfft(states[:, 4:], len(experiment.time), axis=0, norm="ortho")
    output = shafts @ turns.T
    yield "friction about pitch and roll", "N.m", braked(np.column_stack([_sign(r) for r in output.T]) @ turns)
    each = np.column_stack([_sign(r) for r in shafts.T])
    yield "friction in both input shafts", "N.m", braked(each)
    for i in (0, 1):
        yield f"friction in input shaft {i + 1}", "N.m", braked(each * np.eye(2)[i])


def _sign(rate: Array) -> Array:
    found: Array = np.tanh(rate / max(TURNING * float(np.abs(rate).max()), 1e-3))
    return found


def _strength(solution: Solution, i: int) -> tuple[Array, Array]:
    """Ratio (c,) of the channels' noise in the band to the noise at frequencies at which the motors do not move, and the
    relative standard error of the former, which is large if encoders' errors hide the noise. If there are too few such
    frequencies, the ratio is 1."""
    experiment, comparison, found = solution.fitter.experiments[i], solution.comparisons[i], []
    values = experiment.values
    assert values is not None
    there, expected, information = comparison.noise_ratios()
    noise = np.array([solution.noise[name] for name in experiment.channels])
    inside = noise**2 * there / expected + np.mean(experiment.channel_power, axis=0)
    luck = 1 / (2 * inside * np.sqrt(information))
    for j, name in enumerate(experiment.channels):
        column = (values[:, j] - solution.modelled[i][:, j])[np.isfinite(values[:, j])]
        # Missing values are skipped: above the band there is only noise, in any order.
        n = len(column)
        share = experiment.band * 2 * (experiment.sampled[-1] - experiment.sampled[0]) / n
        first = max(int(2 * share * n / 2), n // 8)
        quantum = float(np.mean(experiment.channel_power[:, j]))
        if first + 20 > n // 2:
            found.append(1.0)
            continue
        power = np.abs(np.fft.rfft(np.diff(column) * np.hanning(n - 1)))[first:] ** 2 / np.sum(np.hanning(n - 1) ** 2)
        turn = 2 - 2 * np.cos(2 * np.pi * np.arange(first, first + len(power)) / (n - 1))
        outside = float(np.mean(power / turn))
        found.append(float(np.sqrt(inside[j] / max(outside, quantum, experiment.finest[j] ** 2))))
    return np.array(found), luck


def _where(experiment: Experiment, comparison: Comparison, j: int) -> tuple[float, float]:
    """Frequencies in Hz between which most of a channel's residual is."""
    power = np.sum(comparison.residual[:, :, j] ** 2, axis=0)
    total = np.cumsum(power) / max(float(np.sum(power)), 1e-300)
    spacing = experiment.band / max(experiment.bins - 1, 1)
    return float(spacing * np.searchsorted(total, 0.1)), float(spacing * np.searchsorted(total, 0.9))
