"""Least squares: the parameters with which the FMU comes closest to the measurements.

Parameters are sought as logarithms, which keeps them positive and makes their errors relative. Sensor offsets and the
initial state of each experiment enter linearly; they are eliminated in every evaluation by projection (variable
projection in the form of Kaufman, BIT 15 (1975) 49), so that the search is only over the other unknowns.

Errors of the motors' encoders pass through the model. So at every frequency, the difference of measured and modelled
spectra has the covariance of the channels' noise plus G P G^H, with the model's transfer G and the power P of the
encoders' errors. The difference is weighted with the inverse of this covariance, which depends on the parameters, too.
Without P the dampers are biased (errors in variables; Soderstrom, Automatica 43 (2007) 939, Sec. 8; Pintelon and
Schoukens, 2nd ed., Sec. 9.11). The noise of each channel is given, or estimated from its residuals.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple, cast

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from prw.errors import UserError
from prw.identification.effects import columns, including
from prw.identification.experiment import SEARCHED, Experiment, spectra
from prw.identification.kinds import FILTERS, LINEAR
from prw.identification.model import Model
from prw.identification.response import FURTHEST, Discrete, Distortion, Response, discrete
from prw.motion import Array
from prw.progress import Progress
from prw.state_space import Complex, StateSpace

#: Step of the logarithms in central differences; the relative error of the sensitivities is then about 1e-8.
DIFFERENCE = 1e-4
#: Relative singular value below which a direction of the offsets and the initial state is not estimated.
UNDETERMINED = 1e-9
#: Fitting and estimating the noise alternate for at most ROUNDS rounds (FEW_ROUNDS for the comparison of causes), until
#: the noise changes by less than SETTLED. In each round the noise is estimated at most NOISE_ROUNDS times.
ROUNDS, FEW_ROUNDS, SETTLED = 12, 4, 0.003
NOISE_ROUNDS = 30
#: The patterns of effects are repeated until the unknowns change by less than this.
FOLLOWED = 2e-4
#: Amplitude of hum, in standard errors, which noise exceeds in one of 10 000 recordings.
HUM = 4.3
#: Highest degree of the polynomials that describe the drift of a channel.
DRIFT = 5
#: Least distance of the start of a search from the bounds.
INSIDE = 1e-6
#: Tolerances of a search.
FINE, COARSE = {"ftol": 1e-12, "xtol": 1e-9, "max_nfev": 100}, {"ftol": 1e-5, "xtol": 1e-4, "max_nfev": 25}
#: Two minima are the same if no parameter differs by more than this fraction.
SAME = 0.01
#: Another minimum is reported if its misfit, at the same noise, exceeds the least misfit by less than this.
RIVAL = 9.0


class Prior(NamedTuple):
    """Prior knowledge: the parameter is `value` (SI) with the relative standard deviation `relative`."""

    value: float
    relative: float


@dataclass(frozen=True)
class Task:
    """The unknowns of a fit.

    Attributes
    ----------
    names
        Names of the parameters to estimate.
    start
        All parameters by name, SI.
    bounds
        (least, greatest) by name, SI.
    priors
        Prior knowledge by name.
    noise
        Given standard deviations by channel, SI.
    offsets
        Whether each channel has an unknown offset.
    distortions
        Distortions, whose unknowns follow the logarithms of the parameters in every point (p,).
    drift
        Channels that may drift slowly.
    hum
        Approximate frequency in Hz by channel that contains hum.
    """

    names: tuple[str, ...]
    start: Mapping[str, float]
    bounds: Mapping[str, tuple[float, float]]
    priors: Mapping[str, Prior]
    noise: Mapping[str, float]
    offsets: bool
    distortions: tuple[Distortion, ...]
    drift: tuple[str, ...] = ()
    hum: Mapping[str, float] = field(default_factory=dict)

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of all unknowns: parameters, then distortions."""
        return (*self.names, *map(str, self.distortions))

    @property
    def patterns(self) -> tuple[Distortion, ...]:
        """The distortions that add a pattern, see `effects`."""
        return tuple(d for d in self.distortions if d.kind not in (*FILTERS, *LINEAR))

    @property
    def modelled(self) -> list[int]:
        """Indices of the unknowns that change the linear model."""
        linear = [k for k, d in enumerate(self.distortions, len(self.names)) if d.kind in LINEAR]
        return [*range(len(self.names)), *linear]

    def values(self, logarithms: Array) -> dict[str, float]:
        """All parameters in SI, with the estimated ones at these logarithms."""
        return {**self.start, **dict(zip(self.names, np.exp(logarithms).tolist()))}

    def including(
        self, distortions: tuple[Distortion, ...] = (), drift: tuple[str, ...] = (), priors: Mapping[str, Prior] = {}
    ) -> Task:
        """The task with further distortions, drifting channels, and parameters with priors as unknowns."""
        return replace(
            self,
            names=tuple(dict.fromkeys((*self.names, *priors))),
            distortions=(*self.distortions, *distortions),
            drift=(*self.drift, *drift),
            priors={**priors, **self.priors},
        )

    def first(self) -> Array:
        """Logarithms of the start values of `names`, then zeros, which mean no distortion: (p,)."""
        return np.append(np.log([self.start[name] for name in self.names]), np.zeros(len(self.distortions)))

    def span(self) -> tuple[Array, Array]:
        """The bounds of the unknowns: least (p,) and greatest (p,)."""
        low, high = np.log([self.bounds[name] for name in self.names]).T
        reach = np.full(len(self.distortions), FURTHEST)
        return np.append(low, -reach), np.append(high, reach)

    def prior_information(self) -> Array:
        """Information of the priors about the unknowns: (p, p)."""
        return np.diag([1 / self.priors[n].relative ** 2 if n in self.priors else 0.0 for n in self.unknowns])


@lru_cache(maxsize=16)
def polynomials(count: int) -> Array:
    """Legendre polynomials (count, DRIFT) of the degrees from 1 at `count` points from -1 to 1. Read-only, because every comparison uses
    the same ones."""
    found = np.asarray(np.polynomial.legendre.legvander(np.linspace(-1, 1, count), DRIFT)[:, 1:], dtype=np.float64)
    found.flags.writeable = False
    return found


@lru_cache(maxsize=16)
def _slow_spectra(count: int) -> Complex:
    """Spectra (count // 2 + 1, DRIFT) of `polynomials`, read-only as these."""
    found = spectra(polynomials(count))
    found.flags.writeable = False
    return found


def slow(experiment: Experiment, channels: Sequence[str]) -> Complex:
    """Spectra (needed_bins, c, q) of `polynomials` over time in each of the channels."""
    shapes = _slow_spectra(len(experiment.time))[: experiment.needed_bins]
    found = np.zeros((experiment.needed_bins, len(experiment.channels), 0), dtype=complex)
    for i, name in enumerate(experiment.channels):
        if name in channels:
            more = np.zeros((*found.shape[:2], DRIFT), dtype=complex)
            more[:, i] = shapes
            found = np.concatenate([found, more], axis=2)
    return found


def humming(experiment: Experiment, hum: Mapping[str, float]) -> dict[int, Array]:
    """Cosine and sine (n, 2) of the hum by index of the channel, if its frequency is compared. hum: frequencies in Hz by channel."""
    found = {}
    for i, name in enumerate(experiment.channels):
        if name in hum and hum[name] - SEARCHED <= experiment.band:
            turn = 2 * np.pi * hum[name] * experiment.time
            found[i] = np.column_stack([np.cos(turn), np.sin(turn)])
    return found


def no_hum(solution: Solution) -> dict[str, str]:
    """The channels without hum among those whose hum the fit estimates, each with a note."""
    found: dict[str, list[bool]] = {}
    for comparison in solution.comparisons:
        for name, significant in comparison.hum.items():
            found.setdefault(name, []).append(significant)
    return {
        name: f"no hum of {name} is found at {solution.task.hum[name]:g} Hz, so none is estimated"
        for name, each in found.items()
        if not any(each)
    }


class Comparison:
    """An experiment compared with the model, for one set of parameters and given noise.

    Attributes
    ----------
    residual
        (2, bins, c), real and imaginary parts of the difference of measured and modelled spectra, uncorrelated and of
        variance 1, after elimination of offsets and initial state.
    offsets
        (c,), offsets of the sensors, SI.
    initial
        (6,), difference x[0] - x[n] of the states at the start and at the end.
    drift
        (n, c), drift of the channels, SI, and their hum.
    hum
        Whether the estimated hum of each channel is more than noise, by the channel's name.
    """

    def __init__(
        self,
        experiment: Experiment,
        response: Response,
        task: Task,
        noise: Mapping[str, float],
    ):
        """noise: standard deviations by channel, SI."""
        self.experiment, self.response = experiment, response
        bins, channels = experiment.bins, len(experiment.channels)
        share = experiment.shares
        self._scaled = self.response.transfer[:bins] * share[:, None]
        self._noise = np.array([noise[name] for name in experiment.channels]) ** 2 * share
        stepped = experiment.channel_power * share**2 + self._noise
        covariance = (self._scaled * experiment.motor_power[:, None, :]) @ self._scaled.conj().swapaxes(-1, -2)
        covariance[:, np.arange(channels), np.arange(channels)] += stepped
        self._whiten = np.linalg.inv(np.linalg.cholesky(covariance))
        steady = np.zeros((experiment.needed_bins, channels, channels if task.offsets else 0), dtype=complex)
        steady[0] = np.sqrt(len(experiment.time)) * np.eye(*steady.shape[1:])
        # The first samples of a channel with a delay or lag depend on the time before the recording.
        late = {d.channel for d in task.distortions if d.kind in ("delay", "lag")}
        edges = [i for i, name in enumerate(experiment.channels) if name in late]
        early = np.zeros((experiment.needed_bins, channels, 3 * len(edges)), dtype=complex)
        s = 1j * np.arange(experiment.needed_bins) / experiment.bins
        for k, i in enumerate(edges):
            early[:, i, 3 * k : 3 * k + 3] = s[:, None] ** np.arange(3)
        waves = humming(experiment, task.hum)
        whole = np.zeros((experiment.needed_bins, channels, 2 * len(waves)), dtype=complex)
        for k, (i, wave) in enumerate(waves.items()):
            whole[:, i, 2 * k : 2 * k + 2] = spectra(wave)[: experiment.needed_bins]
        linear = [steady, slow(experiment, task.drift), whole, early, self.response.transients]
        nuisance = experiment.observed(np.concatenate(linear, axis=2))
        difference = np.zeros((bins, channels), dtype=complex)
        if experiment.values is not None:
            difference = experiment.measured - experiment.observed(response.outputs)
        white = self._parts(self._whiten @ np.concatenate([nuisance, difference[:, :, None]], axis=2))
        flat = white.reshape(-1, white.shape[-1])
        left, sizes, right = np.linalg.svd(flat[:, :-1], full_matrices=False)
        determined = sizes > UNDETERMINED * sizes[0]
        self._basis = left[:, determined]
        found = (right[determined].T / sizes[determined]) @ (self._basis.T @ flat[:, -1])
        self.residual = self.project(white[..., -1])
        paths = polynomials(len(experiment.time))
        first, drifting = steady.shape[2], [i for i, name in enumerate(experiment.channels) if name in task.drift]
        self.drift, self.hum = np.zeros((len(experiment.time), channels)), dict[str, bool]()
        self.drift[:, drifting] = paths @ found[first : first + DRIFT * len(drifting)].reshape(-1, DRIFT).T
        first += DRIFT * len(drifting)
        for k, (i, wave) in enumerate(waves.items()):
            both = slice(first + 2 * k, first + 2 * k + 2)
            self.drift[:, i] += wave @ found[both]
            errors = np.linalg.norm(right[determined].T[both] / sizes[determined], axis=1)
            self.hum[experiment.channels[i]] = bool(np.linalg.norm(found[both] / errors) > HUM)
        self.offsets, self.initial = found[:channels] if task.offsets else np.zeros(channels), found[-6:]
        self._rest = difference - nuisance @ found

    @property
    def spread(self) -> float:
        """Twice the sum of the logarithms of all covariances' determinants."""
        diagonal = np.einsum("fcc->fc", self._whiten).real
        return float(-4 * np.log(diagonal).sum())

    def project(self, table: Array) -> Array:
        """Removes the effects of the linear unknowns, such as offsets and initial state, from real and imaginary parts (2, bins, c,
        ...)."""
        flat = table.reshape(len(self._basis), -1)
        return (flat - self._basis @ (self._basis.T @ flat)).reshape(table.shape)

    def slopes(self, change: Discrete) -> tuple[Array, Array]:
        """Derivatives (2, bins, c, p) of `residual`, and the part (p, p) of their squares that is noise.

        change: the model's derivatives with respect to the unknowns that change it.
        The contribution of encoders' errors to the squares is not information. For example, at equal motor rates the difference
        of two encoders' steps seems to roll the wrist a little, and J3 would look determined."""
        outputs, transfer = self.response.slopes(change, self.initial)
        bins, whiten = self.experiment.bins, self._whiten
        errors = np.sqrt(self.experiment.motor_power)[:, None, :]
        moving = np.moveaxis(transfer[:, :bins] * (self.experiment.shares[:, None] * errors), 0, 2)
        # Whitened transfer from the error of each encoder: its changes (bins, c, p, 2) and its value (bins, c, 2).
        direct = (whiten @ moving.reshape(bins, moving.shape[1], -1)).reshape(moving.shape)
        there = (whiten @ (self._scaled * errors)).conj().swapaxes(-1, -2)
        moved = (direct.reshape(bins, -1, 2) @ there).reshape(*moving.shape[:3], -1)
        direct, moved = np.moveaxis(direct, 2, 0), np.moveaxis(moved, 2, 0)
        # Change of the inverse of a Cholesky factor: the lower half of the whitened change of the covariance.
        lower = np.tril(moved + moved.conj().swapaxes(-1, -2))
        diagonal = np.arange(lower.shape[-1])
        lower[..., diagonal, diagonal] /= 2
        followed = (lower @ (whiten @ self._rest[:, :, None]))[..., 0]
        table = self.change_along(outputs) - self.project(self._parts(np.moveaxis(followed, 0, -1)))
        # E |d residual|^2, where d residual = -(whitened dG) n_u - lower r, with errors n_u of the encoders.
        rows = [t.reshape(len(t), -1) for t in (direct, lower, moved)]
        a, s, b = (np.hstack([t.real, t.imag]) for t in rows)
        return table, 2 * (a @ a.T + s @ s.T - b @ s.T - s @ b.T)

    def change_along(self, outputs: Complex) -> Array:
        """Changes (2, bins, c, q) of the residual with changes of the outputs (q, f, c)."""
        return self.project(self._parts(-self._whiten @ self.experiment.observed(np.moveaxis(outputs, 0, -1))))

    def _parts(self, table: Complex) -> Array:
        """Real and imaginary parts (2, bins, ...), each of variance 1, of spectra (bins, ...) of variance 1."""
        found: Array = np.sqrt(2) * np.stack([table.real, table.imag])
        found[:, 0] /= np.sqrt(2)
        if self.experiment.bins == self.experiment.all_bins and len(self.experiment.time) % 2 == 0:
            found[:, -1] /= np.sqrt(2)
        return found

    def score_variance(self, jacobian: Array) -> Array:
        """Variance (p, p) of the score J'r, calculated with drawn errors of the encoders, because in a periodic motion
        these errors repeat with the motion. jacobian: (2, bins, c, p)."""
        scores = np.einsum("rfcp,rfcd->dp", jacobian, self._drawn, optimize=True)
        noise = self._whiten * np.sqrt(self._noise)
        of_noise = np.einsum("fcj,rfcp->rfjp", noise.conj(), jacobian, optimize=True).reshape(-1, jacobian.shape[-1])
        variance: Array = scores.T @ scores / len(scores) + (of_noise.conj().T @ of_noise).real
        return variance

    @cached_property
    def _drawn(self) -> Array:
        """Effect of draws (d) of the encoders' errors on the residual, (2, bins, c, d)."""
        e = self.experiment
        drawn = e.channel_errors * e.shares - (self._scaled @ e.motor_errors[..., None])[..., 0]
        return self._parts(np.moveaxis((self._whiten @ drawn[..., None])[..., 0], 0, -1))

    def noise_ratios(self) -> Array:
        """Sums (3, c) over frequencies. The ratio of the first two is 1 if a channel's noise explains its residuals, and larger
        if the noise is too small. Their difference is proportional to the derivative of the log likelihood with respect to the
        noise's variance. The third sum is the information about the noise's variance, the inverse square of its standard error."""
        inverse = self._whiten.conj().swapaxes(-1, -2) @ self._whiten
        weighted = (inverse @ self._rest[:, :, None])[..., 0]
        expected, share = np.einsum("fcc->c", inverse).real, self.experiment.shares
        information = share * np.einsum("fcc,fcc->c", inverse, inverse).real
        sums: Array = share * np.array([np.sum(np.abs(weighted) ** 2, axis=0), expected, information])
        return sums


@dataclass(frozen=True)
class Solution:
    """The result of a fit.

    Attributes
    ----------
    logarithms
        (p,), logarithms of the parameters, then the distortions.
    noise
        Standard deviations by channel, SI.
    comparisons
        One for each experiment.
    jacobians
        (2, bins, c, p) for each experiment, derivatives of the residuals.
    noise_information
        (p, p), the part of the Jacobians' squares that is noise, see `Comparison.slopes`.
    modelled
        (s, c) for each experiment, the FMU's outputs plus the offsets, SI.
    misfit
        Sum of the squares of residuals and of weighted differences from priors.
    rivals
        Other minima that fit about as well, as (logarithms, misfit).
    tried
        Number of starting points.
    evaluations
        Number of compared sets of parameters.
    fitter
        The fitter that found the solution, ready for other parameters.
    """

    task: Task
    logarithms: Array
    noise: dict[str, float]
    comparisons: list[Comparison]
    jacobians: list[Array]
    noise_information: Array
    modelled: list[Array]
    misfit: float
    rivals: list[tuple[Array, float]]
    tried: int
    evaluations: int
    fitter: Fitter

    @property
    def values(self) -> dict[str, float]:
        """All parameters in SI."""
        return self.task.values(self.logarithms)

    @property
    def deviance(self) -> float:
        """Minus twice the logarithm of the likelihood, up to a constant."""
        return self.misfit + sum(comparison.spread for comparison in self.comparisons)


class Fitter:
    """Compares the experiments with the FMU at any parameters and noise."""

    def __init__(
        self,
        model: Model,
        experiments: Sequence[Experiment],
        task: Task,
        noise: Mapping[str, float] = {},
    ):
        """noise: of all channels, by name, SI; default: as given in the task, else a twentieth of the values' standard deviation."""
        self.model, self.experiments, self.task = model, experiments, task
        self.channels = tuple(dict.fromkeys(name for e in experiments for name in e.channels))
        spread = dict.fromkeys(self.channels, 1e-12)
        self._finest, self._stepped = dict.fromkeys(self.channels, 0.0), dict.fromkeys(self.channels, 0.0)
        for e in experiments:
            for i, name in enumerate(e.channels if e.values is not None else ()):
                spread[name] = max(spread[name], float(np.nanstd(cast(Array, e.values)[:, i])))
                self._finest[name] = max(self._finest[name], float(e.finest[i]))
                self._stepped[name] = max(self._stepped[name], float(e.channel_power[:, i].mean()))
        self.noise = dict(noise) or {n: task.noise.get(n) or 0.05 * spread[n] for n in self.channels}
        self.evaluations = 0
        #: The effects of each experiment (all_bins, c), see `effects`.
        self._effects: list[tuple[dict[Distortion, Complex], Complex | None]] = [({}, None) for _ in experiments]
        self._responses: tuple[bytes, list[Response]] = b"", []
        self._comparisons: tuple[tuple[object, ...], list[Comparison]] = (), []

    def _response(self, logarithms: Array, experiment: Experiment, bins: int) -> Response:
        models = self._discrete(self._models([logarithms]), experiment)
        effects = next(f for e, f in zip(self.experiments, self._effects) if e is experiment)
        model = Discrete(*(block[0] for block in models))
        return Response(model, experiment, bins, self._unknowns(logarithms), *effects)

    def _unknowns(self, logarithms: Array) -> dict[Distortion, float]:
        return dict(zip(self.task.distortions, logarithms[len(self.task.names) :].tolist()))

    def effects(
        self, logarithms: Array, wanted: Sequence[Distortion]
    ) -> list[tuple[dict[Distortion, Complex], Complex]]:
        """For each experiment, the contributions (all_bins, c) of the wanted effects to the channels, per unit of their sizes, and the
        sum of their parts that do not depend on the sizes."""
        sizes = {d: d.value(x) for d, x in self._unknowns(logarithms).items() if d.kind not in (*FILTERS, *LINEAR)}
        (model,), values = self._models([logarithms]), self.task.values(logarithms)
        return [
            columns(model, values, e, self._response(logarithms, e, e.all_bins), comparison.initial, sizes, wanted)
            for e, comparison in zip(self.experiments, self.compare(logarithms))
        ]

    def follow(self, point: Array) -> None:
        """Repeat the patterns of the task's effects for the motion at this point."""
        if wanted := self.task.patterns:
            self._effects = [*self.effects(point, wanted)]
            self._responses, self._comparisons = (b"", []), ((), [])

    def compare(self, logarithms: Array) -> list[Comparison]:
        """Compare every experiment with the FMU at one set of parameters."""
        at = logarithms.tobytes()
        if self._responses[0] != at:
            self.evaluations += 1
            self._responses = at, [self._response(logarithms, e, e.needed_bins) for e in self.experiments]
        key = (at, *self.noise.items())
        if self._comparisons[0] != key:
            parts = zip(self.experiments, self._responses[1])
            self._comparisons = key, [Comparison(e, r, self.task, self.noise) for e, r in parts]
        return self._comparisons[1]

    def jacobians(self, logarithms: Array) -> tuple[list[Array], Array]:
        """For each experiment the derivatives (2, bins, c, p) of the residuals with respect to the logarithms; and the
        part (p, p) of all their squares that is noise."""
        steps = DIFFERENCE * np.eye(len(logarithms))[self.task.modelled]
        around = self._models([*(logarithms + steps), *(logarithms - steps)])
        self.evaluations += 2 * len(steps)
        tables, noise = [], np.zeros((len(logarithms), len(logarithms)))
        for experiment, comparison in zip(self.experiments, self.compare(logarithms)):
            change = self._discrete(around, experiment).slopes(DIFFERENCE)
            table, of_noise = comparison.slopes(change)
            tables.append(table)
            noise += of_noise
        return tables, noise

    def modelled(self, logarithms: Array) -> list[Array]:
        """For each experiment the FMU's outputs (s, c), offsets included, SI."""
        found = []
        for experiment, comparison in zip(self.experiments, self.compare(logarithms)):
            whole = self._response(logarithms, experiment, experiment.all_bins)
            steady = spectra(comparison.drift) + whole.outputs + whole.transients @ comparison.initial
            found.append(experiment.signals(steady) + comparison.offsets)
        return found

    def residuals(self, logarithms: Array) -> Array:
        """All residuals in one row (r,), followed by the weighted differences from the priors."""
        centre, strength = self._priors()
        weighted = (comparison.residual.ravel() for comparison in self.compare(logarithms))
        return np.concatenate([*weighted, strength * (centre - logarithms)])

    def deviance(self, logarithms: Array) -> float:
        """Minus twice the logarithm of the likelihood, up to a constant, without priors' normalization."""
        spread = sum(comparison.spread for comparison in self.compare(logarithms))
        return float(np.sum(self.residuals(logarithms) ** 2)) + spread

    def slopes(self, logarithms: Array) -> Array:
        """Derivatives (r, p) of residuals() with respect to the logarithms."""
        rows = [table.reshape(-1, len(logarithms)) for table in self.jacobians(logarithms)[0]]
        return np.vstack([*rows, -np.diag(self._priors()[1])])

    def search(self, start: Array, tolerances: Mapping[str, float] = FINE, held: int | None = None) -> OptimizeResult:
        """scipy's trust-region least squares from `start` (p,) at the present noise. held: index of a parameter that
        keeps its value in `start`. tolerances: scipy's."""
        free = np.arange(len(start)) != (-1 if held is None else held)
        low, high = (bound[free] for bound in self.task.span())

        def at(moved: Array) -> Array:
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

    def settle(self, point: Array, rounds: int = ROUNDS, tolerances: Mapping[str, float] = FINE) -> Array:
        """Fit and estimate the noise in turns, until the noise settles, but at most `rounds` times."""
        for _ in range(rounds):
            self.follow(point)
            start, before = point, self.noise
            point = self.search(point, tolerances).x
            for _ in range(NOISE_ROUNDS):
                last, self.noise = self.noise, self._judged_noise(point)
                if self._alike(self.noise, last):
                    break
            followed = not self.task.patterns or np.abs(point - start).max() < FOLLOWED
            if self._alike(self.noise, before) and followed:
                break
        return point

    def _judged_noise(self, point: Array) -> dict[str, float]:
        """Each channel's noise over all experiments: given, or estimated from its residuals at the present noise, but
        not below `finest`."""
        sums, freedom = dict.fromkeys(self.channels, np.zeros(3)), dict.fromkeys(self.channels, 0.0)
        for experiment, comparison in zip(self.experiments, self.compare(point)):
            taken = 1 + int(self.task.offsets) + 6 / len(experiment.channels)
            for name, ratio in zip(experiment.channels, comparison.noise_ratios().T):
                sums[name] = sums[name] + ratio
                freedom[name] += 2 * experiment.bins - taken
        each, judged = len(self.task.unknowns) / len(self.channels), {}
        for name, (found, expected, _) in sums.items():
            left = max(freedom[name] - each, 1.0) / max(freedom[name], 1.0)
            noise = self.noise[name] * float(np.sqrt(found / (expected * left)))
            judged[name] = self.task.noise.get(name) or max(noise, self._finest[name])
        return judged

    def _alike(self, noise: Mapping[str, float], other: Mapping[str, float]) -> bool:
        """Whether two estimates of the noise, encoders' steps included, differ by less than SETTLED."""
        return all(
            abs(np.sqrt((noise[n] ** 2 + e) / (other[n] ** 2 + e)) - 1) < SETTLED for n, e in self._stepped.items()
        )

    def _models(self, points: Iterable[Array]) -> list[StateSpace]:
        found = []
        for point in points:
            values, unknowns = self.task.values(point), self._unknowns(point)
            sizes = {d: d.value(x) for d, x in unknowns.items()}
            found.append(including(self.model.at(values), values, sizes))
        return found

    def _discrete(self, models: Sequence[StateSpace], experiment: Experiment) -> Discrete:
        """The models, discretized with the experiment's step."""
        return discrete(models, experiment.step, experiment.channels, experiment.jumps is not None)

    def _priors(self) -> tuple[Array, Array]:
        """Logarithms (p,) of the priors' values, and 1/sigma (p,), 0 where there is none."""
        priors = [self.task.priors.get(name) for name in self.task.unknowns]
        return (
            np.array([np.log(prior.value) if prior else 0.0 for prior in priors]),
            np.array([1 / prior.relative if prior else 0.0 for prior in priors]),
        )


def fit(model: Model, experiments: Sequence[Experiment], task: Task, starts: int = 6, seed: int = 0) -> Solution:
    """Estimate the parameters from `task.start` and `starts` - 1 other starting points; return the best solution.

    If several minima fit about equally well, the one nearest to task.start counts and the others are reported. Raises UserError
    if a start value is out of its bounds or the FMU rejects a value.
    """
    for name in task.names:
        low, high = task.bounds[name]
        if not low < task.start[name] < high:
            raise UserError(f"{name} starts at {task.start[name]:.6g}, outside of its bounds {low:.6g} to {high:.6g}")
    first = task.first()
    fitter, point = _settled(model, experiments, task, first)
    for d in task.patterns if len(task.patterns) > 1 else ():
        # Two effects together may have other minima, which the solution with one of them avoids.
        without = [each for each in task.patterns if each != d]
        alone = replace(task, distortions=tuple(each for each in task.distortions if each not in without))
        at = dict(zip(alone.unknowns, _settled(model, experiments, alone, alone.first(), {}, COARSE)[1]))
        start = np.array([at.get(name, x) for name, x in zip(task.unknowns, first)])
        other, end = _settled(model, experiments, task, start, {}, COARSE)
        if other.deviance(end) < fitter.deviance(point) - RIVAL:
            fitter, point = other, other.settle(end)

    # Other minima, at the noise of the first one.
    minima = [(point, 2 * fitter.search(point).cost)]
    others = _other_starts(task, point, starts - 1, seed)
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
    alike.sort(key=lambda minimum: float(np.sum((minimum[0] - first) ** 2)))
    misfit = alike[0][1]
    if alike[0][0] is not point:
        point = fitter.settle(alike[0][0])
        misfit = 2 * fitter.search(point).cost
    rivals = [(x, chi) for x, chi in alike[1:] if np.abs(x - point).max() > SAME]
    return _solution(fitter, point, misfit, rivals, len(others) + 1)


def _settled(
    model: Model,
    experiments: Sequence[Experiment],
    task: Task,
    start: Array,
    noise: Mapping[str, float] = {},
    tolerances: Mapping[str, float] = FINE,
) -> tuple[Fitter, Array]:
    """A fitter whose noise and effects agree with its minimum, and this minimum (p,). noise: at the start, as for Fitter."""
    fitter = Fitter(model, experiments, task, noise)
    fitter.follow(start)
    rounds = FEW_ROUNDS if tolerances is COARSE else ROUNDS
    return fitter, fitter.settle(fitter.search(start, COARSE).x, rounds, tolerances)


def _solution(fitter: Fitter, point: Array, misfit: float, rivals: list[tuple[Array, float]], tried: int) -> Solution:
    compared, jacobians = fitter.compare(point), fitter.jacobians(point)
    modelled, count = fitter.modelled(point), fitter.evaluations
    return Solution(
        fitter.task, point, fitter.noise, compared, *jacobians, modelled, misfit, rivals, tried, count, fitter
    )


def refitted(
    solution: Solution,
    distortions: tuple[Distortion, ...] = (),
    drift: tuple[str, ...] = (),
    priors: Mapping[str, Prior] = {},
    tolerances: Mapping[str, float] = COARSE,
) -> Solution:
    """Repeat the fit with further distortions, drifting channels and parameters as unknowns. By default it is just accurate enough to
    compare causes. The fit starts from the solution. If a parameter then differs from its start value by more than a factor of
    e, the fit is repeated from the start values, and the better one counts."""
    was = solution.task
    task = was.including(distortions, drift, priors)
    names = task.names
    at = dict(zip(was.unknowns, solution.logarithms.tolist()))
    first = task.first()
    starts = [np.array([at.get(name, x) for name, x in zip(task.unknowns, first)]), first]
    found = []
    for start_point in starts:
        last = solution.fitter
        fitter, point = _settled(last.model, last.experiments, task, start_point, solution.noise, tolerances)
        misfit = float(np.sum(fitter.residuals(point) ** 2))
        found.append(_solution(fitter, point, misfit, [], solution.tried))
        if np.abs(point[: len(names)] - first[: len(names)]).max() < 1:
            break
    return min(found, key=lambda each: each.deviance)


def _other_starts(task: Task, point: Array, count: int, seed: int) -> list[Array]:
    """Starting points for other minima: within a factor of 3 of task.start, and the exchanged couplings.

    Torque, pitch and roll depend on the two couplings of a side in series, and do not change if the couplings are
    exchanged; only theta3 and theta4 distinguish the couplings. So the mirror image is tried first.
    """
    starts = []
    index = {name: i for i, name in enumerate(task.names)}
    if {"k1", "k2", "c1", "c2"} <= set(index) and count > 0:
        mirrored = point.copy()
        for a, b in (("k1", "k2"), ("c1", "c2")):
            mirrored[[index[a], index[b]]] = point[[index[b], index[a]]]
        starts.append(mirrored)
    random = np.random.default_rng(seed)
    (low, high), first = task.span(), task.first()
    while len(starts) < count:
        moved = random.uniform(-np.log(3), np.log(3), len(task.names))
        starts.append(np.clip(first + np.append(moved, np.zeros(len(task.distortions))), low, high))
    return starts
