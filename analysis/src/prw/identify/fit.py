"""Least squares: the parameters with which the FMU comes closest to what was measured.

Parameters are sought as logarithms, which keeps them positive and makes their errors relative. Sensor offsets and the
initial state of each experiment enter linearly; they are eliminated in every evaluation by projection (variable
projection in the form of Kaufman, BIT 15 (1975) 49), so that the search is over the parameters alone. The noise of
each channel is that of its residuals, or given.

What is compared are spectra, up to the frequency at which the motors' motion drowns in the noise of their samples. An
encoder's steps above that band would pass through the model and be taken for motion, which biases damping most (errors
in variables, Soderstrom, Automatica 43 (2007) 939). Cutting measurement and model alike biases nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from scipy.fft import rfft
from scipy.optimize import least_squares

from prw.errors import UserError
from prw.identify.experiment import Experiment
from prw.identify.model import Model
from prw.identify.path import quantum_of, rounding
from prw.progress import Progress

#: Step of the logarithms for the central differences: errors of 1e-8 in the sensitivities.
DIFFERENCE = 1e-4
#: Directions of the initial state that the data see this much less than others are left alone.
UNSEEN = 1e-9
#: Rounds of fitting and judging the noise, and the change at which they end.
ROUNDS, SETTLED = 12, 0.003
#: A channel cannot be more exact than this fraction of its range: doubles and CSV digits end somewhere.
FINEST = 1e-9
#: A search starts at least this far inside its bounds.
INSIDE = 1e-6
#: When a search ends.
FINE, COARSE = {"ftol": 1e-12, "xtol": 1e-9, "max_nfev": 100}, {"ftol": 1e-5, "xtol": 1e-4, "max_nfev": 25}
#: Two minima are the same if no parameter differs by more than this fraction.
SAME = 0.01
#: Another minimum is reported if it is no more than this worse, in terms of -2 log likelihood.
RIVAL = 9.0


class Prior(NamedTuple):
    """What is known beforehand: the parameter is `value` (SI) give or take the fraction `relative` (one sigma)."""

    value: float
    relative: float


@dataclass(frozen=True)
class Task:
    """What to estimate. names: of the parameters. start: all parameters in SI by name. bounds: (least, greatest) by
    name, SI. priors: by name. noise: given standard deviations by channel, SI. offsets: whether each channel has an
    unknown one. initial: whether the initial states are unknown (else rest)."""

    names: Tuple[str, ...]
    start: Mapping[str, float]
    bounds: Mapping[str, Tuple[float, float]]
    priors: Mapping[str, Prior]
    noise: Mapping[str, float]
    offsets: bool = True
    initial: bool = True

    def values(self, logarithms) -> Dict[str, float]:
        """All parameters in SI, with the estimated ones at these logarithms."""
        return {**self.start, **dict(zip(self.names, np.exp(logarithms).tolist()))}

    def span(self) -> Tuple[np.ndarray, np.ndarray]:
        """The bounds of the logarithms of `names`: least (p,) and greatest (p,)."""
        low, high = np.log([self.bounds[name] for name in self.names]).T
        return low, high

    def prior_information(self) -> np.ndarray:
        """What the priors know about the logarithms of `names`: (p, p)."""
        return np.diag([1 / self.priors[n].relative ** 2 if n in self.priors else 0.0 for n in self.names])


class Evaluation(NamedTuple):
    """The fit at one set of parameters, a list item for each experiment. residuals: (2 b, c) weighted spectra, real
    parts above imaginary ones, nuisances taken out. offsets: (c,) SI. states: (6,) what is added to rest. modelled:
    (n, c) with offsets, SI."""

    residuals: List[np.ndarray]
    offsets: List[np.ndarray]
    states: List[np.ndarray]
    modelled: List[np.ndarray]


@dataclass(frozen=True)
class Solution:
    """What was found. logarithms: (p,) of the parameters. noise: by channel, SI; of white noise that is as strong in
    the band. jacobians: for each experiment (2 b, c, p), weighted like the residuals, nuisances taken out. spurious:
    (p, p), information that is none, see Fitter.spurious. misfit: sum of squares of weighted residuals and priors.
    rivals: other minima that fit as well, as (logarithms, misfit). evaluations: simulations that were made. fitter:
    what found it, ready to compare at other parameters."""

    task: Task
    logarithms: np.ndarray
    noise: Dict[str, float]
    evaluation: Evaluation
    jacobians: List[np.ndarray]
    spurious: np.ndarray
    misfit: float
    rivals: List[tuple]
    tried: int
    evaluations: int
    fitter: Fitter

    @property
    def values(self) -> Dict[str, float]:
        """All parameters in SI."""
        return self.task.values(self.logarithms)


class Fitter:
    """The experiments and the FMU, ready to be compared at any parameters and noise."""

    def __init__(self, model: Model, experiments: Sequence[Experiment], task: Task):
        self.model, self.experiments, self.task = model, experiments, task
        self.noise: Dict[str, float] = {}
        self.evaluations = 0
        self._projections: List[_Nuisance] = []
        self._at: Optional[tuple] = None

    def evaluate(self, logarithms: np.ndarray) -> Evaluation:
        """Compare at one set of parameters."""
        key = (logarithms.tobytes(), tuple(self.noise.items()))
        if self._at is not None and self._at[0] == key:
            return self._at[1]
        values = self.task.values(logarithms)
        self._projections = []
        result = Evaluation([], [], [], [])
        for experiment in self.experiments:
            weights = self._weights(experiment)
            simulated = experiment.simulate(self.model, [values])[0]
            self.evaluations += 1
            difference = np.where(weights > 0, np.nan_to_num(experiment.values) - simulated, 0.0)
            transients = experiment.transients(self.model, values) if self.task.initial else None
            nuisance = _Nuisance(weights, experiment.bins(), transients, self.task.offsets)
            residual, offsets, state = nuisance.solve(difference)
            self._projections.append(nuisance)
            result.residuals.append(residual)
            result.offsets.append(offsets)
            result.states.append(state)
            result.modelled.append(simulated + offsets + (0.0 if transients is None else transients @ state))
        self._at = (key, result)
        return result

    def jacobians(self, logarithms: np.ndarray) -> List[np.ndarray]:
        """Derivatives of the weighted model spectra by the logarithms, nuisances taken out: (2 b, c, p) each."""
        evaluation, neighbours = self.evaluate(logarithms), self._neighbours(logarithms)
        found = []
        for experiment, state, nuisance in zip(self.experiments, evaluation.states, self._projections):
            start = experiment.rest() + state if self.task.initial else None
            found.append(nuisance.project(_slopes(experiment.simulate(self.model, neighbours, start))))
            self.evaluations += len(neighbours)
        return found

    def spurious(self, logarithms: np.ndarray, draws: int = 3) -> np.ndarray:
        """The part (p, p) of the information that comes from the noise of the motors' samples passing for motion.

        With equal motors, say, the difference of two encoders' steps seems to roll the wrist a little. It does not,
        and what the fit concludes from it about J3 is wrong; here the same noise is drawn without any motion."""
        self.evaluate(logarithms)
        neighbours, random = self._neighbours(logarithms), np.random.default_rng(0)
        total = np.zeros((len(logarithms), len(logarithms)))
        for experiment, nuisance in zip(self.experiments, self._projections):
            for _ in range(draws if experiment.paths else 0):
                table = experiment.follow(self.model, neighbours, *experiment.wander(random))
                flat = nuisance.project(_slopes(table)).reshape(-1, len(logarithms))
                total += flat.T @ flat / draws
        return total

    def feigned(self, logarithms: np.ndarray, draws: int) -> List[List[np.ndarray]]:
        """What noise like that of the motors' samples, and like the steps of quantised channels, does to the residuals:
        for each draw, spectra (2 b, c) for each experiment, weighted, nuisances taken out."""
        evaluation, random = self.evaluate(logarithms), np.random.default_rng(1)
        values, found = self.task.values(logarithms), []
        for experiment, nuisance, modelled in zip(self.experiments, self._projections, evaluation.modelled):
            quanta = self._quanta(experiment)
            for draw in range(draws):
                table = experiment.follow(self.model, [values], *experiment.wander(random))[0]
                for i, quantum in quanta.items():
                    table[:, i] += rounding(modelled[:, i], quantum, random)
                found.append((draw, nuisance.project(table)))
        return [[spectra for draw, spectra in found if draw == wanted] for wanted in range(draws)]

    def _quanta(self, experiment: Experiment) -> Dict[int, float]:
        """The quantum of each channel, by column, where no other noise blurs it."""
        found = {}
        for i, name in enumerate(experiment.channels):
            values = experiment.values[:, i]
            quantum = quantum_of(values[np.isfinite(values)])
            if quantum > self.noise[name]:
                found[i] = quantum
        return found

    def residuals(self, logarithms: np.ndarray) -> np.ndarray:
        """All weighted residuals in one row, and how far the parameters are off their priors: (r,)."""
        centre, strength = self._priors()
        weighted = (residual.ravel() for residual in self.evaluate(logarithms).residuals)
        return np.concatenate([*weighted, strength * (centre - logarithms)])

    def slopes(self, logarithms: np.ndarray) -> np.ndarray:
        """Derivatives (r, p) of residuals() by the logarithms."""
        rows = [-jacobian.reshape(-1, len(logarithms)) for jacobian in self.jacobians(logarithms)]
        return np.vstack([*rows, -np.diag(self._priors()[1])])

    def search(self, start: np.ndarray, tolerances=FINE, held: Optional[int] = None):
        """scipy's trust-region least squares from `start` (p,) at the present noise. held: a parameter that stays
        where `start` has it. tolerances: scipy's, for when to end."""
        free = np.arange(len(start)) != (-1 if held is None else held)
        low, high = (bound[free] for bound in self.task.span())

        def at(moved: np.ndarray) -> np.ndarray:
            point = start.copy()
            point[free] = moved
            return point

        found = least_squares(
            lambda moved: self.residuals(at(moved)),
            np.clip(start[free], low + INSIDE, high - INSIDE),
            lambda moved: self.slopes(at(moved))[:, free],
            bounds=(low, high),
            method="trf",
            gtol=1e-12,
            **tolerances,
        )
        found.x = at(found.x)
        return found

    def _priors(self) -> tuple:
        """Logarithms (p,) of the priors' values, and 1/sigma (p,), 0 where there is none."""
        priors = [self.task.priors.get(name) for name in self.task.names]
        return (
            np.array([np.log(prior.value) if prior else 0.0 for prior in priors]),
            np.array([1 / prior.relative if prior else 0.0 for prior in priors]),
        )

    def judge_noise(self, evaluation: Evaluation) -> Dict[str, float]:
        """Strength of each channel's residuals in the band, over all experiments, as that of white noise in SI, where
        none is given."""
        squares: Dict[str, float] = {}
        counts: Dict[str, float] = {}
        for experiment, residual in zip(self.experiments, evaluation.residuals):
            nuisances = int(self.task.offsets) + (6 / len(experiment.channels) if self.task.initial else 0)
            share = (len(residual) - 1) / len(experiment.time)
            for i, name in enumerate(experiment.channels):
                squares[name] = squares.get(name, 0.0) + np.sum((residual[:, i] * self.noise[name]) ** 2)
                counts[name] = counts.get(name, 0.0) + share * np.isfinite(experiment.values[:, i]).sum() - nuisances
        each = len(self.task.names) / len(squares)
        judged = {name: float(np.sqrt(squares[name] / max(counts[name] - each, 1.0))) for name in squares}
        return {name: self.task.noise.get(name) or max(judged[name], self._finest(name)) for name in squares}

    def first_noise(self) -> Dict[str, float]:
        """Where nothing is known yet: a twentieth of each channel's motion."""
        return {name: self.task.noise.get(name) or 0.05 * self._spread(name) for name in self.channels}

    @property
    def channels(self) -> Tuple[str, ...]:
        """The channels of all experiments."""
        return tuple(dict.fromkeys(name for e in self.experiments for name in e.channels))

    def _spread(self, name: str) -> float:
        columns = [e.values[:, e.channels.index(name)] for e in self.experiments if name in e.channels]
        return max(max(float(np.nanstd(column)) for column in columns), 1e-12)

    def _finest(self, name: str) -> float:
        return FINEST * self._spread(name)

    def _weights(self, experiment: Experiment) -> np.ndarray:
        return np.isfinite(experiment.values) / np.array([self.noise[name] for name in experiment.channels])

    def _neighbours(self, logarithms: np.ndarray) -> List[Dict[str, float]]:
        """The parameters a little further, and a little back, in the direction of each: 2 p sets."""
        steps = DIFFERENCE * np.eye(len(logarithms))
        return [self.task.values(x) for x in np.vstack([logarithms + steps, logarithms - steps])]


def _slopes(table: np.ndarray) -> np.ndarray:
    """Derivatives (n, c, p) from the outputs (2 p, n, c) of Fitter._neighbours."""
    count = len(table) // 2
    return np.moveaxis(table[:count] - table[count:], 0, -1) / (2 * DIFFERENCE)


class _Nuisance:
    """Offsets and initial state of one experiment: solved for, and projected out of residuals and sensitivities."""

    def __init__(self, weights: np.ndarray, bins: int, transients: Optional[np.ndarray], offsets: bool):
        """weights: (n, c), 1/noise or 0. bins: number of frequencies that are compared. transients: (n, c, 6) or
        None."""
        self._weights, self._bins, channels = weights, bins, weights.shape[1]
        columns = [np.eye(channels)[None] * np.ones((len(weights), 1, 1))] if offsets else []
        columns += [transients] if transients is not None else []
        self._counts = channels if offsets else 0, 6 if transients is not None else 0
        self._basis = None
        if columns:
            table = self._spectra(np.concatenate(columns, axis=2))
            left, sizes, right = np.linalg.svd(table.reshape(-1, table.shape[2]), full_matrices=False)
            seen = sizes > UNSEEN * sizes[0]
            self._basis, self._back = left[:, seen], right[seen].T / sizes[seen]

    def _spectra(self, table: np.ndarray) -> np.ndarray:
        # A unitary transform: where all frequencies are kept, sums of squares are those of the samples.
        n = len(table)
        w = self._weights.reshape(self._weights.shape + (1,) * (table.ndim - 2))
        found = rfft(table * w, axis=0, norm="ortho", workers=-1)[: self._bins] * np.sqrt(2)
        found[0] /= np.sqrt(2)
        if n % 2 == 0 and self._bins == n // 2 + 1:
            found[-1] /= np.sqrt(2)
        return np.concatenate([found.real, found.imag])

    def project(self, table: np.ndarray) -> np.ndarray:
        """Weighted spectra with what offsets and initial state could explain taken out. table: (n, c) or (n, c, p)."""
        result = self._spectra(table)
        if self._basis is None:
            return result
        flat = result.reshape(len(self._basis), -1)
        return (flat - self._basis @ (self._basis.T @ flat)).reshape(result.shape)

    def solve(self, difference: np.ndarray) -> tuple:
        """Weighted residual spectra, offsets (c,) and initial state (6,) that explain most of `difference` (n, c)."""
        result = self._spectra(difference)
        offsets, state = np.zeros(difference.shape[1]), np.zeros(6)
        if self._basis is not None:
            seen = self._basis.T @ result.ravel()
            result = result - (self._basis @ seen).reshape(result.shape)
            found, (first, second) = self._back @ seen, self._counts
            offsets = found[:first] if first else offsets
            state = found[first:] if second else state
        return result, offsets, state


def fit(model: Model, experiments: Sequence[Experiment], task: Task, starts: int = 6, seed: int = 0) -> Solution:
    """Estimate, from `task.start` and `starts` - 1 other places, of which the best counts.

    Where several minima fit alike, the one nearest to task.start counts and the others are reported. Raises UserError
    where a parameter is out of its bounds or the FMU refuses something.
    """
    fitter = Fitter(model, experiments, task)
    for name in task.names:
        low, high = task.bounds[name]
        if not low < task.start[name] < high:
            raise UserError(f"{name} starts at {task.start[name]:.6g}, outside of its bounds {low:.6g} to {high:.6g}")
    first = np.log([task.start[name] for name in task.names])
    fitter.noise = fitter.first_noise()
    point = fitter.search(first, COARSE).x
    fitter.noise = fitter.judge_noise(fitter.evaluate(point))
    point = _settle(fitter, point)

    # Other minima, at the noise that the first one has.
    minima = [(point, 2 * fitter.search(point).cost)]
    others = _other_starts(task, fitter.channels, point, starts - 1, seed)
    with Progress("looking for other minima", len(others)) as progress:
        for done, start in enumerate(others):
            progress(done)
            found = fitter.search(start, COARSE)
            better = 2 * found.cost < min(misfit for _, misfit in minima) + max(RIVAL, 0.05 * len(found.fun))
            if not better or any(np.abs(found.x - x).max() < SAME for x, _ in minima):
                continue
            found = fitter.search(found.x)
            if not any(np.abs(found.x - x).max() < SAME for x, _ in minima):
                minima.append((found.x, 2 * found.cost))
    best = min(misfit for _, misfit in minima)
    alike = [minimum for minimum in minima if minimum[1] < best + RIVAL]
    alike.sort(key=lambda minimum: np.sum((minimum[0] - first) ** 2))
    point = _settle(fitter, alike[0][0])
    misfit = 2 * fitter.search(point).cost
    evaluation, jacobians, spurious = fitter.evaluate(point), fitter.jacobians(point), fitter.spurious(point)
    rivals = [(x, chi) for x, chi in alike[1:] if np.abs(x - point).max() > SAME]
    return Solution(
        task,
        point,
        fitter.noise,
        evaluation,
        jacobians,
        spurious,
        misfit,
        rivals,
        len(others) + 1,
        fitter.evaluations,
        fitter,
    )


def _settle(fitter: Fitter, point: np.ndarray) -> np.ndarray:
    """Fit and judge the noise by turns, until the noise settles."""
    for _ in range(ROUNDS):
        point = fitter.search(point).x
        before, fitter.noise = fitter.noise, fitter.judge_noise(fitter.evaluate(point))
        if all(abs(fitter.noise[name] / before[name] - 1) < SETTLED for name in before):
            break
    return point


def _other_starts(task: Task, channels, point: np.ndarray, count: int, seed: int) -> List[np.ndarray]:
    """Starting points to look for other minima: within a factor of 3 of task.start, and the exchanged couplings.

    Torque, pitch and roll see the two couplings of a side in series, which is the same when they change places; only
    theta3 and theta4, between them, can tell. So the mirror image is tried first.
    """
    starts = []
    place = {name: i for i, name in enumerate(task.names)}
    if {"k1", "k2", "c1", "c2"} <= set(place) and count > 0:
        mirrored = point.copy()
        for a, b in (("k1", "k2"), ("c1", "c2")):
            mirrored[[place[a], place[b]]] = point[[place[b], place[a]]]
        starts.append(mirrored)
    random = np.random.default_rng(seed)
    low, high = task.span()
    first = np.log([task.start[name] for name in task.names])
    while len(starts) < count:
        starts.append(np.clip(first + random.uniform(-np.log(3), np.log(3), len(first)), low, high))
    return starts
