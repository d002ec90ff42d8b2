"""Whether the model explains the data, and by what else they would be explained.

The residuals of a fit that is right are noise. They are tested against the motion: by local regression on the motors'
spectra and the channel's own, frequency by frequency (their coherence); along what single faults would leave (a delay,
a lag or a gain of a channel, or of two in common; friction; backlash), as score tests (Rao, Proc. Cambridge Phil. Soc.
44 (1948) 50); and their strength is compared with that of the noise at frequencies at which the motors do not move.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from prw.identification.experiment import Experiment, spectra
from prw.identification.fit import Comparison, Distortion, Solution
from prw.identification.statistics import covariance_of, information_of
from prw.motion import Array
from prw.state_space import Complex
from prw.testbed import OUTPUTS

#: Chance that a channel of a good fit looks coherent with the motion: little, for an encoder's steps are not as normal as it
#: assumes, and in slow motion 1e-8 was seen; a fault's estimate over its error that is no
#: chance, and from which on intervals grow to cover it.
CHANCE, CLEAR, SMALL = 1e-10, 4.7, 2.5
#: The same for what follows the sign of a rate, which in a periodic motion encoders' steps do, too.
CLEAR_SIGN = 7.0
#: A channel's noise in the band may be this much stronger than above it, besides what chance does in so few values.
EXCESS, LUCK = 1.3, 5.0
#: Frequencies for each piece in which the residual may follow the motion in its own way, and pieces at most.
PIECE, MOST_PIECES = 16, 6
#: A course that moves is this many times stronger (power) than the errors that encoders make in it.
CLEARLY_MOVING = 30.0
#: Directions that the others explain to this share are none.
NEW = 0.02
#: A rate that is this share of its greatest has a sign.
TURNING = 0.02


#: Channels that come in pairs, through one amplifier or converter.
PAIRS = (("tau1", "tau2"), ("theta3", "theta4"), ("pitch", "roll"), ("pitch_rate", "roll_rate"))


def groups(channels: Sequence[str]) -> list[tuple[str, ...]]:
    """Channels that a fault may have in common: each alone, pairs, all."""
    found = [(name,) for name in channels] + [pair for pair in PAIRS if set(pair) <= set(channels)]
    return found + [tuple(channels)] * (len(channels) > 2)


def named(kind: str, group: Sequence[str]) -> str:
    """The name of a fault that channels have in common."""
    return f"{kind} of {' and '.join(group) if len(group) < 3 else 'all channels'}"


class Fault(NamedTuple):
    """One thing that may be wrong. name, unit: of its size. size, error: estimated along with the parameters, and
    standard error. shift: (p,), what it would change of the unknowns. gain: rise of twice the log likelihood."""

    name: str
    unit: str
    size: float
    error: float
    shift: Array
    gain: float

    @property
    def signs(self) -> bool:
        """Whether it follows the sign of a rate."""
        return self.name.startswith(("friction", "backlash"))

    @property
    def clear(self) -> float:
        """Its size in standard errors."""
        return abs(self.size) / self.error if self.error > 0 else 0.0


class Misfit(NamedTuple):
    """What the model does not explain of a channel. low, high: Hz, where most of it is."""

    experiment: str
    channel: str
    low: float
    high: float
    text: str

    def __str__(self) -> str:
        return f"{self.channel}: {self.text} ({self.low:.3g} to {self.high:.3g} Hz)"


class Verdict(NamedTuple):
    """misfits: what the model does not explain; none where it fits. faults: single things that were tried, the
    clearest first. widening: (p,) standard deviations, of what is too small to be told from chance."""

    misfits: tuple[Misfit, ...]
    faults: tuple[Fault, ...]
    widening: Array

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
            return _Score(solution, i, comparison.seen_along(columns), inverse)

        spread, luck = _strength(solution, i)
        for j, name in enumerate(experiment.channels):
            there = score(_following(experiment, comparison, j))
            chance = there.chance(2 * experiment.bins)
            texts = []
            if chance < CHANCE:
                texts.append("what the FMU does not explain follows the motors")
            if spread[j] > EXCESS * (1 + LUCK * luck[j]):
                texts.append(
                    f"the residual is {float(f'{spread[j]:.2g}'):g} times the noise at frequencies at which the motors rest"
                )
            if texts:
                misfits.append(Misfit(experiment.name, name, *_where(experiment, comparison, j), "; ".join(texts)))
        for name, unit, column in single_faults(solution, experiment, comparison):
            fault = score(column[None]).fault(name, unit)
            # Neither friction nor backlash is ever negative.
            if fault is not None and (fault.size > 0 or not fault.signs):
                faults.append(fault)
    faults.sort(key=lambda fault: -fault.clear)
    widening = np.zeros(len(inverse))
    for fault in faults:
        if fault.clear > SMALL:
            widening = np.maximum(widening, np.abs(fault.shift))
    clear = [fault for fault in faults if fault.clear > (CLEAR_SIGN if fault.signs else CLEAR)]
    if clear and not misfits:
        fault = clear[0]
        e = solution.fitter.experiments[0]
        text = f"{fault.name} of {fault.size:.3g} +- {fault.error:.1g} {fault.unit}".rstrip()
        for channel in [name for name in e.channels if name in fault.name.split()] or ["all"]:
            misfits.append(Misfit(e.name, channel, 0.0, e.band, f"{text} would explain more of the data"))
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
        self._variance = solution.comparisons[i].score_variance(rest)
        self._information = flat.T @ rest.reshape(flat.shape)
        for other, comparison in enumerate(solution.comparisons):
            if other != i:
                self._variance += comparison.score_variance(solution.jacobians[other] @ self._shift)

    def chance(self, count: int) -> float:
        """Probability of so much along all directions in a fit that is right, with noise judged by `count` values."""
        values, vectors = np.linalg.eigh(self._information)
        whiten = vectors[:, values > NEW] / np.sqrt(values[values > NEW])
        k = whiten.shape[1]
        if not k:
            return 1.0
        # White residuals have the variance 1 in all directions. DRAWS of encoders' errors tell where there is more, but
        # they are too few to tell where there is less.
        variance, turn = np.linalg.eigh(whiten.T @ self._variance @ whiten)
        ratio = float(np.sum((turn.T @ whiten.T @ self._score) ** 2 / np.maximum(variance, 1.0)))
        left = max(count - ratio, 0.02 * count) / max(count - k, 1)
        return float(fdtrc(k, max(count - k, 1), ratio / k / left))

    def fault(self, name: str, unit: str) -> Fault | None:
        """The size of the one direction; none where the parameters explain it as well."""
        left = float(self._information[0, 0])
        if left < 1e-6:
            return None
        size = float(self._score[0]) / left
        error = float(np.sqrt(self._variance[0, 0])) / left
        scale = self._size[0]
        after = self._residual - size * self._rest[..., 0]
        before, after = (np.sum(each**2, axis=(0, 1)) for each in (self._residual, after))
        gain = (
            2 * self._residual.shape[1] * float(np.sum(np.log(np.maximum(before, 1e-300) / np.maximum(after, 1e-300))))
        )
        return Fault(name, unit, -size / scale, error / scale, self._shift[:, 0] * size, gain)


def _following(experiment: Experiment, comparison: Comparison, j: int) -> Complex:
    """What follows the motors, and the channel itself, in channel j: columns (q, f, c), smooth over frequencies. They
    are 0 where encoders' errors make up much of them: the residual contains the same errors."""
    bins, response = experiment.bins, comparison.response
    pieces = int(np.clip(bins // PIECE, 1, MOST_PIECES))
    place = np.linspace(0, pieces - 1 + 1e-9, bins)
    hats = np.maximum(0, 1 - np.abs(place - np.arange(pieces)[:, None]))
    own = response.outputs[:, j] + response.transients[:, j] @ comparison.initial
    motors = [(experiment.motors[:, i], np.eye(2)[i]) for i in (0, 1)]
    columns = []
    for course, gains in [*motors, (own, response.transfer[:bins, j])]:
        errors = np.sum(np.abs(gains) ** 2 * experiment.motor_power, axis=1)
        clear = hats @ (np.abs(course[:bins]) ** 2 - CLEARLY_MOVING * errors) > 0
        there = np.zeros((pieces, experiment.needed_bins, len(experiment.channels)), dtype=complex)
        there[clear, :bins, j] = hats[clear] * course[:bins]
        columns += [there, 1j * there]
    return np.concatenate(columns)


def single_faults(
    solution: Solution, experiment: Experiment, comparison: Comparison
) -> Iterator[tuple[str, str, Complex]]:
    """Name, unit and what it adds to the channels (f, c) per unit, of single faults."""
    response, count = comparison.response, experiment.needed_bins
    there = response.outputs + response.transients @ comparison.initial
    s: Complex = 2j * np.pi * np.arange(count, dtype=complex) / (len(experiment.time) * experiment.step)
    # A lag is the same as a delay to first order. What two channels have in common may be ten standard errors where it is
    # one and two of each alone, because parameters make up for the rest.
    for kind, unit in (("delay", "ms"), ("gain", "")):
        for group in groups(experiment.channels):
            distortions = {Distortion(kind, name) for name in group}
            if distortions & set(solution.task.distortions) or (kind == "gain" and len(group) > 2):
                continue
            places = [experiment.channels.index(name) for name in group]
            column = np.zeros_like(there)
            column[:, places] = Distortion(kind, group[0]).response(0.0, s)[1][:, None] * there[:, places]
            yield named(kind, group), unit, column
    turning = [_sign(experiment.omega[:, i]) for i in (0, 1)]
    signs = spectra(np.column_stack(turning))[:count]
    yield "backlash at the motors", "rad", -(response.transfer @ signs[..., None])[..., 0] / 2
    for i, name in enumerate(("tau1", "tau2")):
        if name in experiment.channels:
            column = np.zeros_like(there)
            column[:, experiment.channels.index(name)] = signs[:, i]
            yield f"friction at motor {i + 1}", "N.m", column
    model, known = solution.fitter.model.at(solution.values), solution.values
    turns = model.C[[OUTPUTS.index("pitch_rate"), OUTPUTS.index("roll_rate")]][:, 4:]
    inertia = known["J2"] * np.eye(2) + turns.T @ np.diag([known["H3"], known["J3"]]) @ turns
    states, through = response.moving(comparison.initial)
    rates = np.fft.irfft(states[:, 4:] @ turns.T, len(experiment.time), axis=0, norm="ortho")
    brake = np.linalg.solve(inertia, turns.T)
    signs = spectra(np.column_stack([_sign(rates[:, i]) for i in (0, 1)]))[:count]
    column = (through[:, :, 4:] @ brake @ signs[..., None])[..., 0]
    yield "friction about pitch and roll", "N.m", -experiment.step * column


def _sign(rate: Array) -> Array:
    found: Array = np.tanh(rate / max(TURNING * float(np.abs(rate).max()), 1e-3))
    return found


def _strength(solution: Solution, i: int) -> tuple[Array, Array]:
    """Noise of the channels (c,) in the band over that at frequencies at which the motors do not move, and the standard
    error of the former as a fraction: it is large where encoders' errors hide the noise."""
    experiment, comparison, found = solution.fitter.experiments[i], solution.comparisons[i], []
    values = experiment.values
    assert values is not None
    there, expected, told = comparison.noise_ratios()
    noise = np.array([solution.noise[name] for name in experiment.channels])
    inside = noise**2 * there / expected + np.mean(experiment.channel_power, axis=0)
    luck = 1 / (2 * inside * np.sqrt(told))
    for j, name in enumerate(experiment.channels):
        column = (values[:, j] - solution.modelled[i][:, j])[np.isfinite(values[:, j])]
        # Values that are missing are skipped: what is left above the band is noise in any order.
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
    """Frequencies in Hz between which lies most of a channel's residual."""
    power = np.sum(comparison.residual[:, :, j] ** 2, axis=0)
    total = np.cumsum(power) / max(float(np.sum(power)), 1e-300)
    spacing = experiment.band / max(experiment.bins - 1, 1)
    return float(spacing * np.searchsorted(total, 0.1)), float(spacing * np.searchsorted(total, 0.9))
