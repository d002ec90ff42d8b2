"""Tests whether the model explains the data, and whether a fault would explain them.

The residuals of a correct fit are noise, which four tests check. Local regression over frequency
finds residuals that are coherent with the motors' spectra or the channel's own. Score tests (Rao, Proc. Cambridge Phil.
Soc. 44 (1948) 50) find the effects of single hypotheses, such as a delay of a channel or friction. The third test compares the
residuals' strength with the noise above the frequencies at which the motors move, and the fourth with the channel's motion.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import fdtrc

from prw.identification.experiment import Experiment
from prw.identification.fit import Comparison, Solution, slow
from prw.identification.kinds import FILTERS, KINDS, Kind
from prw.identification.response import Distortion
from prw.identification.statistics import MARGIN, covariance_of, information_of
from prw.motion import Array
from prw.state_space import Complex

#: Probability below which a coherence with the motion is a misfit. It is small, because the steps of encoders are not normally
#: distributed: in slow motion, probabilities of 1e-8 occur in correct fits.
CHANCE = 1e-10
#: Ratios of the size of a fault to its standard error. Above CLEAR the fault is significant, above NOTED a note names it, and above
#: SMALL it widens intervals. EVERYWHERE always widens them, because every bearing has some friction, and no two couplings are equal.
CLEAR, NOTED, SMALL = 4.7, 4.0, 2.5
EVERYWHERE = ("friction", "asymmetry")
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
#: A channel is not explained if less than this share of its motion is, and the residual is more than FAR times the noise.
EXPLAINED, FAR = 0.5, 3.0


#: Pairs of channels, which often share an amplifier or converter.
PAIRS = (("tau1", "tau2"), ("theta3", "theta4"), ("pitch", "roll"), ("pitch_rate", "roll_rate"))


class Hypothesis(NamedTuple):
    """What may distinguish the rig or its record from the FMU: a kind of KINDS or a drift, at one or more places."""

    kind: str
    places: tuple[str, ...]

    def __str__(self) -> str:
        if self.kind in KINDS and KINDS[self.kind].places:
            return " and ".join(map(str, self.distortions))
        if self.kind == "inertias":
            return "inertias that differ from the start values"
        return f"{self.kind} of {' and '.join(self.places) if len(self.places) < 3 else 'all channels'}"

    @property
    def distortions(self) -> tuple[Distortion, ...]:
        """The distortions of the hypothesis; none for a drift."""
        return tuple(Distortion(self.kind, place) for place in self.places if self.kind in KINDS)

    @property
    def signs(self) -> bool:
        """Whether it follows the sign of a rate or a twist."""
        return self.kind in ("friction", "backlash", "clearance")

    @property
    def positive(self) -> bool:
        """Whether it is never negative."""
        return self.kind in KINDS and KINDS[self.kind].positive

    @property
    def belongs(self) -> bool:
        """Whether it is a property of the rig, with which the data may be explained."""
        return self.kind == "drift" or (self.kind in KINDS and KINDS[self.kind].belongs)


def hypotheses(solution: Solution, kind: str, channels: Sequence[str] = ()) -> list[Hypothesis]:
    """The hypotheses of a kind that the fit does not contain yet. Filters may apply to single channels (default: all), to pairs and,
    except for gains, to all together; a drift to single channels."""
    task, channels = solution.task, channels or solution.fitter.channels
    if kind == "drift":
        return [Hypothesis(kind, (name,)) for name in channels if name not in task.drift]
    places: list[tuple[str, ...]] = [(place,) for place in KINDS[kind].places] or [(name,) for name in channels]
    if kind in FILTERS:
        places += [pair for pair in PAIRS if set(pair) <= set(channels)]
        if len(channels) > 2 and kind != "gain":
            places.append(tuple(channels))
    found = [Hypothesis(kind, group) for group in places]
    return [each for each in found if not set(each.distortions) & set(task.distortions)]


class Fault(NamedTuple):
    """A possible fault.

    Attributes
    ----------
    hypothesis
        What it is.
    size, error
        Size in SI, a gain as its logarithm, estimated together with the parameters; and its standard error.
    shift
        (p,), change of the unknowns that the fault would cause.
    per_error
        (p,), change of the unknowns by one standard error of the size.
    gain
        Rise of twice the log likelihood if the fault is included.
    """

    hypothesis: Hypothesis
    size: float
    error: float
    shift: Array
    per_error: Array
    gain: float

    def __str__(self) -> str:
        kind = KINDS.get(self.hypothesis.kind, Kind(1.0))
        return " of ".join(kind.worded(str(self.hypothesis), self.size, self.error))

    @property
    def signs(self) -> bool:
        """Whether the fault follows the sign of a rate or a twist."""
        return self.hypothesis.signs

    @property
    def clear(self) -> float:
        """Size in standard errors."""
        return abs(self.size) / self.error if self.error > 0 else 0.0

    @property
    def possible(self) -> bool:
        """Whether the size may be other than 0: friction and backlash, for example, are never negative."""
        return self.size > 0 or not self.hypothesis.positive

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
        return next((fault for fault in self.faults if fault.clear > NOTED), None)

    @property
    def fits(self) -> bool:
        """Whether the model explains the data."""
        return not self.misfits


def judge(solution: Solution) -> Verdict:
    """Test the residuals of a fit."""
    inverse = covariance_of(solution.task.prior_information() + information_of(solution.jacobians))
    misfits: list[Misfit] = []
    faults: list[Fault] = []
    tried = [kind for kind in KINDS if kind not in FILTERS]
    additions = [each for kind in tried for each in hypotheses(solution, kind)]
    effects = solution.fitter.effects(solution.logarithms, [d for each in additions for d in each.distortions])
    for i, (experiment, comparison) in enumerate(zip(solution.fitter.experiments, solution.comparisons)):

        def score(columns: Complex, i: int = i, comparison: Comparison = comparison) -> _Score:
            return _Score(solution, i, comparison.change_along(columns), inverse)

        spread, luck = _strength(solution, i)
        explained = _unexplained(solution, i)
        for j, name in enumerate(experiment.channels):
            there = score(_following(experiment, comparison, j))
            chance = there.chance(2 * experiment.bins)
            reasons = []
            if chance < CHANCE:
                reasons.append("the unexplained part follows the motors")
            if spread[j] > EXCESS * (1 + LUCK * luck[j]):
                reasons.append(
                    f"the residual is {float(f'{spread[j]:.2g}'):g} times as strong as at higher frequencies, where the motors do not "
                    "move and only noise remains"
                )
            if explained[j]:
                reasons.append("the residual is about as large as the motion")
            if reasons:
                misfits.append(Misfit(experiment.name, name, *_where(experiment, comparison, j), "; ".join(reasons)))
        found = [(each, effects[i][0][d]) for each in additions for d in each.distortions if effects[i][0][d].any()]
        for hypothesis, column in [*_rows(solution, i), *found]:
            fault = score(column[None, : experiment.needed_bins]).fault(hypothesis)
            if fault is not None:
                faults.append(fault)
    widening = np.zeros(len(inverse))
    for fault in faults:
        if fault.hypothesis.kind in EVERYWHERE or fault.clear > SMALL:
            widening = np.maximum(widening, fault.bias)
    gain, count = common_gain(solution), len(solution.task.names)
    widening[:count] = np.hypot(widening[:count], abs(gain))
    faults = sorted((fault for fault in faults if fault.possible), key=lambda fault: -fault.clear)
    clear = [fault for fault in faults if fault.clear > (CLEAR_SIGN if fault.signs else CLEAR)]
    if clear and not misfits:
        fault = clear[0]
        e = solution.fitter.experiments[0]
        for channel in [name for name in e.channels if name in fault.hypothesis.places] or ["all"]:
            misfits.append(Misfit(e.name, channel, 0.0, e.band, f"{fault} would explain more of the data"))
    return Verdict(tuple(misfits), tuple(faults), widening)


def common_gain(solution: Solution) -> float:
    """Mean logarithm of the gains of all torque channels, if they are estimated but the inertias are not, else 0. Such a gain looks like
    inertias that are wrong by the same factor, with which all stiffness and damping would differ by that factor, too."""
    unknowns, torques = solution.task.unknowns, [n for n in solution.fitter.channels if n.startswith("tau")]
    gains = [str(Distortion("gain", name)) for name in torques]
    if not torques or not set(gains) <= set(unknowns) or {"J2", "J3", "H3"} & set(unknowns):
        return 0.0
    return float(np.mean([solution.logarithms[unknowns.index(name)] for name in gains]))


def _unexplained(solution: Solution, i: int) -> list[bool]:
    """Whether the residual of each channel (c) is so large that the model hardly explains the channel."""
    values, found = solution.fitter.experiments[i].values, []
    assert values is not None
    for j, name in enumerate(solution.fitter.experiments[i].channels):
        quantum = float(np.mean(solution.fitter.experiments[i].channel_power[:, j]))
        rms = float(np.sqrt(np.nanmean((values[:, j] - solution.modelled[i][:, j]) ** 2)))
        far = rms > FAR * np.sqrt(solution.noise[name] ** 2 + quantum)
        found.append(bool(far and rms > (1 - EXPLAINED) * np.nanstd(values[:, j])))
    return found


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

    def fault(self, hypothesis: Hypothesis) -> Fault | None:
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
        return Fault(hypothesis, -size / scale, error / scale, shift * size, np.abs(shift) * error, gain)


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


def _rows(solution: Solution, i: int) -> Iterator[tuple[Hypothesis, Complex]]:
    """Hypotheses on single channels, with their contribution to the channels (f, c) of experiment i per unit of their size. A drift
    has several contributions, one after the other."""
    experiment, comparison = solution.fitter.experiments[i], solution.comparisons[i]
    response, count = comparison.response, experiment.needed_bins
    there = response.outputs + response.transients @ comparison.initial
    s: Complex = 2j * np.pi * np.arange(count, dtype=complex) / (len(experiment.time) * experiment.step)
    # A lag is the same as a delay to first order. A common fault of two channels may have ten standard errors, while each
    # single one has one or two, because the parameters compensate for the latter.
    for kind in ("delay", "gain"):
        for hypothesis in hypotheses(solution, kind, experiment.channels):
            indices = [experiment.channels.index(name) for name in hypothesis.places]
            column = np.zeros_like(there)
            change = hypothesis.distortions[0].response(0.0, s)[1] / KINDS[kind].scale
            column[:, indices] = change[:, None] * there[:, indices]
            yield hypothesis, column
    for hypothesis in hypotheses(solution, "drift", experiment.channels):
        yield from ((hypothesis, column) for column in np.moveaxis(slow(experiment, hypothesis.places), 2, 0))


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
