"""Smooth paths of the motors through quantised or noisy samples of their angles (and rates).

A simulation can derive rates only from past angles. The steps of an encoder then cause noise in the torque that is far
above the noise of the sensor. Identification knows the whole recording, so it can draw a smooth path: a quintic spline, whose
coefficients are the most probable ones if the jerk is a white process and the samples contain white noise. The variances
of both are estimated by maximum likelihood; the variance of an encoder's errors is at least quantum^2 / 12.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.optimize import minimize
from scipy.sparse import csr_matrix, diags

from prw.motion import Array

#: A sparse matrix from the coefficients to a measured quantity, and its measured values.
Block = tuple[csr_matrix, Array]
DEGREE = 5
#: Differences of the coefficients of this order are penalized; third differences are proportional to jerk.
ORDER = 3
#: Range of log10 of the penalty: below, the path interpolates; above, the normal equations lose their digits.
STIFFNESS = (-6.0, 10.0)
#: RATIO: range of log10 of the weight of logged rates, s^2. GUESSES: start values of the search for this weight, by
#: the number of blocks.
RATIO = (-14.0, 4.0)
GUESSES: dict[int, list[list[float]]] = {1: [[]], 2: [[-2.0], [-4.0], [-6.0]]}
#: Divisor of the most probable penalty. Too little smoothing adds some noise, too much biases the parameters. The highest
#: frequency that the path follows rises by the sixth root of the divisor, 1.6.
UNDERSMOOTHING = 16.0
#: Errors of encoders are drawn along a smoother path: OVERSMOOTHING multiplies the penalty, and RESCALED is the largest
#: relative change of the angles. If the motor is slow, a path that follows the encoder's steps is rounded to these steps
#: again, and the drawn errors are up to three times too large.
OVERSMOOTHING, RESCALED = 64.0, 0.05
#: Tolerance, as a fraction of the quantum, within which all values of a column must be multiples of the quantum.
ON_GRID = 0.05
#: Maximum number of quanta between neighbouring values of a typical column.
MAX_STEPS = 50
#: If the variance exceeds the variance of the encoder's steps by this factor, the samples contain other noise.
NOISIER = 1.2
#: Number of values at the start of a column that are used to find the quantum.
QUANTUM_VALUES = 20000


class Path(NamedTuple):
    """The path of one motor angle.

    Attributes
    ----------
    angle
        Spline over the time (s), in rad; its derivative is the rate.
    noise
        Standard deviation of the samples, rad.
    quantum
        Step of the encoder, rad, or 0 if the samples have none.
    rate_noise
        Standard deviation of the logged rates, rad/s, or None if there are none.
    quiet
        (n,) rad, a smoother path at the times of the samples, which does not follow their errors.
    """

    angle: BSpline
    noise: float
    quantum: float
    rate_noise: float | None
    quiet: Array

    def errors(self, random: np.random.Generator) -> Array:
        """Draw errors (n,) of the samples, rad."""
        if self.noise >= self.quantum:
            return random.normal(0, self.noise, len(self.quiet))
        return rounding(self.quiet, self.quantum, random)


def smooth(time: Array, theta: Array, omega: Array | None = None, quantum: float = 0.0) -> Path:
    """The most probable path through the angles theta (n,) rad and, if logged, rates omega (n,) rad/s at the times
    (n,) s, which may be uneven. quantum: of the angles in rad, if it is coarser than the data suggest."""
    quantum = max(quantum, quantum_of(theta))
    spline = _Spline(time)
    blocks = [(spline.rows(time, 0), theta)] + ([(spline.rows(time, 1), omega)] if omega is not None else [])
    found = _fit(spline, blocks, quantum**2 / 12)
    rate_noise = None if omega is None else found.noise / float(np.sqrt(found.weights[1]))
    return Path(spline.curve(found.coefficients), found.noise, quantum, rate_noise, spline.curve(found.quiet)(time))


def quantum_of(values: Array) -> float:
    """The largest step of which all `values` (n,) are multiples, apart from a common constant; 0 if there is none."""
    levels = np.unique(values[:QUANTUM_VALUES])
    if len(levels) < 3:
        return float(np.ptp(levels))
    gaps = np.diff(levels)
    # If digits were truncated, one level may appear as two values, so small gaps are left out. The remaining gaps are
    # multiples of the quantum.
    gaps = gaps[gaps > np.median(gaps) / MAX_STEPS]
    quantum = gaps.min()
    for _ in range(3):
        multiples = np.rint(gaps / quantum)
        quantum = gaps.sum() / multiples.sum()
    off = np.abs(gaps / quantum - np.rint(gaps / quantum))
    return float(quantum) if off.max() < ON_GRID and np.median(np.rint(gaps / quantum)) < MAX_STEPS else 0.0


def rough_noise(values: Array) -> float:
    """An upper estimate of the standard deviation of white noise on smooth values (n,). Third differences nearly remove smooth
    values, and multiply the variance of the noise by 20. Infinite for fewer than four values."""
    return float(np.std(np.diff(values, 3)) / np.sqrt(20)) if len(values) > 3 else np.inf


def rounding(values: Array, quantum: float, random: np.random.Generator) -> Array:
    """Draw an encoder's errors at the values (n,). An encoder has the same error at the same angle, and so in every
    period of a motion."""
    # `values` still contain a part of the samples' errors, so a random offset and scale avoid rounding to the same grid.
    level = values * (1 + random.uniform(-RESCALED, RESCALED)) / quantum + random.uniform()
    return (np.rint(level) - level) * quantum


class _Spline:
    """A spline with knots at the spacing of the samples, and its penalty in banded storage."""

    def __init__(self, time: Array):
        self.spacing = float(np.median(np.diff(time)))
        pieces = max(1, int(np.ceil((time[-1] - time[0]) / self.spacing - 1e-6)))
        self.spacing = (time[-1] - time[0]) / pieces
        self._knots = time[0] + self.spacing * np.arange(-DEGREE, pieces + DEGREE + 1)
        # Times may be outside of these knots by rounding errors, so `rows` clips them.
        self._ends = self._knots[DEGREE], self._knots[-DEGREE - 1]
        self.size = pieces + DEGREE
        self.penalties = self.size - ORDER
        difference = diags([-1.0, 3.0, -3.0, 1.0], range(ORDER + 1), shape=(self.penalties, self.size), format="csr")
        self.penalty = _squared(difference)

    def curve(self, coefficients: Array) -> BSpline:
        return BSpline(self._knots, coefficients, DEGREE)

    def rows(self, time: Array, derivative: int) -> csr_matrix:
        """Sparse matrix (n, size) from coefficients to the spline's value (or derivative) at the times."""
        time = np.clip(time, *self._ends)
        if derivative == 0:
            return BSpline.design_matrix(time, self._knots, DEGREE)
        # The derivative on even knots: differences of the coefficients, in the basis of one degree less.
        lower = BSpline.design_matrix(time, self._knots[1:-1], DEGREE - 1)
        shape = (lower.shape[1], self.size)
        return lower @ diags([-1.0 / self.spacing, 1.0 / self.spacing], [0, 1], shape=shape, format="csr")


class _Fit(NamedTuple):
    """Coefficients of the path and of a smoother path, the noise of the first block (rad), and the weights of the blocks
    relative to the first one (ratios of their variances)."""

    coefficients: Array
    quiet: Array
    noise: float
    weights: list[float]


def _fit(spline: _Spline, blocks: list[Block], least: float) -> _Fit:
    """The most probable path. blocks: the measurements. least: lower bound of the first block's variance, rad2."""
    count = sum(len(values) for _, values in blocks) - ORDER
    normals = [_squared(rows) for rows, _ in blocks]
    rights = [rows.T @ values for rows, values in blocks]

    def solve(penalty: float, weights: list[float]) -> tuple[Array, float, float]:
        """Coefficients, misfit with penalty, and the logarithm of the determinants in the likelihood."""
        normal = penalty * spline.penalty + sum(w * n for w, n in zip(weights, normals))
        factor = cholesky_banded(normal, overwrite_ab=True, check_finite=False)
        right = sum(w * r for w, r in zip(weights, rights))
        coefficients = cho_solve_banded((factor, False), right, check_finite=False)
        misfit = sum(w * np.sum((values - rows @ coefficients) ** 2) for w, (rows, values) in zip(weights, blocks))
        bend = np.diff(coefficients, ORDER)
        spread = 2 * np.log(factor[-1]).sum() - spline.penalties * np.log(penalty)
        return coefficients, float(misfit + penalty * (bend @ bend)), float(spread)

    def most_probable(variance: float | None) -> tuple[float, list[float]]:
        """Penalty and weights with the maximum likelihood. `deviance` is minus twice the log-likelihood."""

        def deviance(x: Sequence[float]) -> float:
            weights = _weights(x)
            _, misfit, spread = solve(10.0 ** np.clip(x[0], *STIFFNESS), weights)
            spread -= float(sum(len(values) * np.log(w) for w, (_, values) in zip(weights, blocks)))
            if variance is None:
                return count * float(np.log(max(misfit, np.finfo(float).tiny))) + spread
            return misfit / variance + spread

        guesses = GUESSES[len(blocks)]
        grid = [[float(x), *guess] for x in np.linspace(*STIFFNESS, 10) for guess in guesses]
        best = min(grid, key=deviance)
        found = minimize(deviance, best, method="Nelder-Mead", options={"xatol": 0.05, "fatol": 0.5}).x
        return float(10.0 ** np.clip(found[0], *STIFFNESS)), _weights(found)

    variance = least
    if least == 0 or rough_noise(blocks[0][1]) ** 2 > NOISIER * least:
        penalty, weights = most_probable(None)
        variance = solve(penalty, weights)[1] / count
    if variance <= least and least > 0:
        variance = least
        penalty, weights = most_probable(variance)
    quiet = solve(min(penalty * OVERSMOOTHING, 10.0 ** STIFFNESS[1]), weights)[0]
    penalty = max(penalty / UNDERSMOOTHING, 10.0 ** STIFFNESS[0])
    return _Fit(solve(penalty, weights)[0], quiet, float(np.sqrt(variance)), weights)


def _squared(rows: csr_matrix) -> Array:
    """rows.T @ rows in the banded storage of `cholesky_banded`."""
    product = rows.T @ rows
    banded = np.zeros((DEGREE + 1, product.shape[0]))
    for i in range(DEGREE + 1):
        banded[DEGREE - i, i:] = product.diagonal(i)
    return banded


def _weights(x: Sequence[float]) -> list[float]:
    """Weights of the blocks from the logarithms that are optimised."""
    return [1.0, *(float(10.0 ** np.clip(y, *RATIO)) for y in x[1:])]
