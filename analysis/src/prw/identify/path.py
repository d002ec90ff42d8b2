"""Where the motors really were: a smooth path through quantised or noisy samples of their angles (and rates).

The FMU derives rates from angles as a simulation must, from the past; the steps of an encoder then become noise in the
torque that is far above that of the sensor. Here the whole recording is known. The path is a quintic spline, its
coefficients the most probable ones if the jerk is a white process and the samples carry white noise. How strong either
is follows from the recording by maximum likelihood; an encoder's noise is at least quantum^2 / 12.
"""

from __future__ import annotations

from functools import partial
from typing import Callable, NamedTuple, Optional

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import minimize
from scipy.sparse import diags

DEGREE = 5
#: The penalty is on third differences of the coefficients: jerk.
ORDER = 3
#: Range of log10 of the penalty: below, the path interpolates; above, the normal equations lose their digits.
STIFFNESS = (-6.0, 10.0)
#: Range of log10 of the weight of logged rates, s^2, and where the search for it begins, for one block and for two.
RATIO = (-14.0, 4.0)
GUESSES = {1: [[]], 2: [[-2.0], [-4.0], [-6.0]]}
#: The most probable penalty is divided by this. Angles smoothed too little add a little noise; smoothed too much they
#: bias the parameters. It raises the frequency up to which the path follows by its sixth root, 1.6.
UNDERSMOOTHING = 16.0
#: Encoders' errors are drawn along a path whose penalty is this many times the most probable one, and that is longer or
#: shorter by up to a fraction. One that follows the encoder's steps would be rounded to the same steps again wherever
#: the motor is slow, and the errors drawn would be up to three times too large.
OVERSMOOTHING, RESCALED = 64.0, 0.05
#: A column is a multiple of a quantum if all its values are, to this fraction of the quantum.
ON_GRID = 0.05
#: So many quanta at most lie between neighbouring values of a typical column.
MOST_STEPS = 50
#: Values that are looked at to find the quantum.
QUANTUM_VALUES = 20000


class Path(NamedTuple):
    """The motion of one motor. angle: spline of the angle over time (rad, s); its derivative is the rate. noise:
    standard deviation of the samples, rad. quantum: of the samples, rad, 0 if none. rate_noise: of the logged rates,
    rad/s, or None. follows: frequency up to which the path follows the samples, Hz. wander: draws what noise like
    theirs, smoothed the same way, adds to the path."""

    angle: BSpline
    noise: float
    quantum: float
    rate_noise: Optional[float]
    follows: float
    wander: Callable[[np.random.Generator], BSpline]


def smooth(time: np.ndarray, theta: np.ndarray, omega: Optional[np.ndarray] = None, quantum: float = 0.0) -> Path:
    """The most probable path of a motor through the angles theta (n,) rad and, where logged, rates omega (n,) rad/s at
    the times (n,) s, which may be uneven. quantum: of the angles in rad, where it is known to be coarser than it
    looks."""
    quantum = max(quantum, quantum_of(theta))
    spline = _Spline(time)
    angles = spline.rows(time, 0)
    blocks = [(angles, theta)] + ([(spline.rows(time, 1), omega)] if omega is not None else [])
    coefficients, quiet, noise, penalty, weights, solve = _fit(spline, blocks, quantum)
    strengths = noise / np.sqrt(weights)

    path, quiet = spline.curve(coefficients), spline.curve(quiet)(time)

    def error(random: np.random.Generator) -> np.ndarray:
        if noise >= quantum:
            return random.normal(0, noise, len(time))
        return rounding(quiet, quantum, random)

    def wander(random: np.random.Generator) -> BSpline:
        errors = [error(random)] + [random.normal(0, strength, len(time)) for strength in strengths[1:]]
        drawn = (w * (rows.T @ values) for w, values, (rows, _) in zip(weights, errors, blocks))
        return spline.curve(solve(sum(drawn)))

    rate_noise = float(strengths[1]) if omega is not None else None
    follows = penalty ** (-1 / (2 * ORDER)) / (2 * np.pi * spline.spacing)
    return Path(path, noise, quantum, rate_noise, min(follows, 0.5 / spline.spacing), wander)


def quantum_of(values: np.ndarray) -> float:
    """The step that all `values` (n,) are multiples of, give or take a constant, or 0 if there is none."""
    levels = np.unique(values[:QUANTUM_VALUES])
    if len(levels) < 3:
        return 0.0
    gaps = np.diff(levels)
    # Digits cut off in the file make two values of one level; what is left of the gaps is one quantum or several.
    gaps = gaps[gaps > np.median(gaps) / MOST_STEPS]
    quantum = gaps.min()
    for _ in range(3):
        multiples = np.rint(gaps / quantum)
        quantum = gaps.sum() / multiples.sum()
    off = np.abs(gaps / quantum - np.rint(gaps / quantum))
    return float(quantum) if off.max() < ON_GRID and np.median(np.rint(gaps / quantum)) < MOST_STEPS else 0.0


def rounding(values: np.ndarray, quantum: float, random: np.random.Generator) -> np.ndarray:
    """Errors like those an encoder makes at the values (n,). It errs the same way at the same angle, and so alike in
    every period of a motion."""
    # What is left of the samples' own errors in `values` must not meet the grid it came from: another zero, another
    # scale.
    level = values * (1 + random.uniform(-RESCALED, RESCALED)) / quantum + random.uniform()
    return (np.rint(level) - level) * quantum


class _Spline:
    """A spline with knots at the spacing of the samples, and its penalty in banded storage."""

    def __init__(self, time: np.ndarray):
        self.spacing = float(np.median(np.diff(time)))
        pieces = max(1, int(np.ceil((time[-1] - time[0]) / self.spacing - 1e-6)))
        self.spacing = (time[-1] - time[0]) / pieces
        self._knots = time[0] + self.spacing * np.arange(-DEGREE, pieces + DEGREE + 1)
        # Not the first and last time themselves, which may lie outside by rounding.
        self._ends = self._knots[DEGREE], self._knots[-DEGREE - 1]
        self.size = pieces + DEGREE
        difference = np.array([1.0])
        for _ in range(ORDER):
            difference = np.convolve(difference, [1.0, -1.0])
        self.penalties = max(self.size - ORDER, 0)
        self.penalty = np.zeros((DEGREE + 1, self.size))
        for i in range(ORDER + 1):
            for j in range(i + 1):
                self.penalty[DEGREE - (i - j), i : i + self.penalties] += difference[i] * difference[j]

    def curve(self, coefficients: np.ndarray) -> BSpline:
        return BSpline(self._knots, coefficients, DEGREE)

    def rows(self, time: np.ndarray, derivative: int):
        """Sparse matrix (n, size) from coefficients to the spline's value (or derivative) at the times."""
        time = np.clip(time, *self._ends)
        if derivative == 0:
            return BSpline.design_matrix(time, self._knots, DEGREE)
        # The derivative on even knots: differences of the coefficients, in the basis of one degree less.
        lower = BSpline.design_matrix(time, self._knots[1:-1], DEGREE - 1)
        shape = (lower.shape[1], self.size)
        return lower @ diags([-1.0 / self.spacing, 1.0 / self.spacing], [0, 1], shape=shape, format="csr")


def _fit(spline: _Spline, blocks, quantum: float) -> tuple:
    """The coefficients, those of a quieter path, and what goes with them: noise of the first block (rad), penalty,
    weight of the second block relative to the first (the ratio of their variances), and what solves for coefficients
    again. blocks: (rows, values) of what was measured."""
    count = sum(len(values) for _, values in blocks) - ORDER
    normals, rights = [], []
    for rows, values in blocks:
        product = rows.T @ rows
        normal = np.zeros((DEGREE + 1, spline.size))
        for i in range(DEGREE + 1):
            normal[DEGREE - i, i:] = product.diagonal(i)
        normals.append(normal)
        rights.append(rows.T @ values)

    def factorize(penalty: float, weights) -> np.ndarray:
        normal = penalty * spline.penalty + sum(w * n for w, n in zip(weights, normals))
        return cholesky_banded(normal, overwrite_ab=True, check_finite=False)

    def solve(penalty: float, weights) -> tuple:
        factor = factorize(penalty, weights)
        right = sum(w * r for w, r in zip(weights, rights))
        coefficients = cho_solve_banded((factor, False), right, check_finite=False)
        misfit = sum(w * np.sum((values - rows @ coefficients) ** 2) for w, (rows, values) in zip(weights, blocks))
        bend = np.diff(coefficients, ORDER)
        spread = 2 * np.log(factor[-1]).sum() - spline.penalties * np.log(penalty)
        return coefficients, misfit + penalty * (bend @ bend), spread

    def most_probable(variance: Optional[float]) -> tuple:
        """Minus twice the logarithm of the likelihood at its minimum over penalty and weights, as (penalty,
        weights)."""

        def unlikeliness(x) -> float:
            weights = _weights(x)
            _, misfit, spread = solve(10.0 ** np.clip(x[0], *STIFFNESS), weights)
            spread -= sum(len(values) * np.log(w) for w, (_, values) in zip(weights, blocks))
            if variance is None:
                return count * np.log(max(misfit, np.finfo(float).tiny)) + spread
            return misfit / variance + spread

        grid = [[x, *guess] for x in np.linspace(*STIFFNESS, 10) for guess in GUESSES[len(blocks)]]
        best = min(grid, key=unlikeliness)
        found = minimize(unlikeliness, best, method="Nelder-Mead", options={"xatol": 0.05, "fatol": 0.5}).x
        return 10.0 ** np.clip(found[0], *STIFFNESS), _weights(found)

    least = quantum**2 / 12
    penalty, weights = most_probable(None)
    variance = solve(penalty, weights)[1] / count
    if variance < least:
        variance = least
        penalty, weights = most_probable(variance)
    quiet = solve(min(penalty * OVERSMOOTHING, 10.0 ** STIFFNESS[1]), weights)[0]
    penalty = max(penalty / UNDERSMOOTHING, 10.0 ** STIFFNESS[0])
    again = partial(cho_solve_banded, (factorize(penalty, weights), False), check_finite=False)
    return solve(penalty, weights)[0], quiet, float(np.sqrt(variance)), penalty, weights, again


def _weights(x) -> list:
    """Weights of the blocks from the logarithms that are optimised."""
    return [1.0, *(10.0 ** np.clip(y, *RATIO) for y in x[1:])]
