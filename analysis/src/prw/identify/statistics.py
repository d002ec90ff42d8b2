"""How sure the estimates are, and which combination of parameters the data do not determine.

Two information matrices. F = sum J'J, of the weighted sensitivities J, is the Fisher information if the noise is
white; its inverse is the smallest covariance that any unbiased estimate can have. Real noise is not white: a smoothed
encoder, a filtered sensor, a quantised angle. The residuals' covariance is F^-1 S F^-1 with S = sum J' R J over
frequencies and the residuals' auto- and cross-spectra R, estimated from the residuals (Ljung, System Identification,
2nd ed., Sec. 9.4-9.5). Encoders repeat their errors with the motion, and residuals do not show all of that: what they
do to the estimates is drawn instead (parametric bootstrap; Efron and Tibshirani 1993, Sec. 6.5).
"""

from __future__ import annotations

from typing import List, Mapping, NamedTuple, Sequence

import numpy as np
from scipy.ndimage import convolve1d
from scipy.special import ndtri

from prw.identify.fit import Solution
from prw.identify.profile import ends

#: Neighbouring frequencies over which the residuals' spectrum is averaged.
NEIGHBOURS = 121
#: Beyond this, condition numbers are rounding.
WORST_CONDITION = 1e15
#: Exponents of intervals end here: a double can hold them.
WIDEST = 600.0
#: A frequency counts in proportion to this power of its leverage: fully, and the one strongest line would be all
#: there is.
POWER = 0.5
#: A frequency counts at least by this share of the one with the most leverage.
LEAST_WEIGHT = 1e-6
#: A residual that the parameters can make vanish is not blown up beyond this.
LEAST_FREEDOM = 0.1
#: A combination of parameters that is uncertain by more than this fraction (one sigma) counts as not determined.
UNDETERMINED = 0.3
#: Information counts as far as it exceeds this many times what the noise of the motors' samples feigns.
MARGIN = 3.0
#: Draws of encoders' errors.
DRAWS = 16
#: Parameters that take less than this share in a combination are not named.
SHARE = 0.15


class Combination(NamedTuple):
    """A direction that the data leave open. shares: exponent by parameter, the largest 1: the parameters can change
    together like p -> p * x^share. error: standard deviation of log x."""

    shares: Mapping[str, float]
    error: float

    def __str__(self) -> str:
        moves = ", ".join(f"{name} {(1.1**share - 1) * 100:+.0f} %" for name, share in self.shares.items())
        if len(self.shares) == 1:
            return f"{next(iter(self.shares))} has hardly any effect on what was measured"
        names = list(self.shares)
        return f"{', '.join(names[:-1])} and {names[-1]} cannot be told apart: {moves} together change next to nothing"


class Certainty(NamedTuple):
    """names: of the parameters (p). relative: (p,) standard errors as fractions. low, high: (p,) ends of the 95 %
    intervals, SI. correlation: (p, p). information: (p, p) Fisher information of the logarithms, priors included,
    without what is feigned. condition: of its unit-diagonal form. whiteness: by how much the noise's correlation
    widens the errors, (p,). undetermined: combinations that the data leave open."""

    names: Sequence[str]
    relative: np.ndarray
    low: np.ndarray
    high: np.ndarray
    covariance: np.ndarray
    correlation: np.ndarray
    information: np.ndarray
    condition: float
    whiteness: np.ndarray
    undetermined: List[Combination]


def certainty(solution: Solution, level: float = 0.95) -> Certainty:
    """Standard errors, correlation, intervals and open combinations of a fit."""
    names = solution.task.names
    prior = solution.task.prior_information()
    bread, meat = prior.copy(), prior.copy()
    for jacobian in solution.jacobians:
        flat = jacobian.reshape(-1, len(names))
        bread += flat.T @ flat
    white = covariance_of(bread)
    for jacobian, residual in zip(solution.jacobians, solution.evaluation.residuals):
        meat += correlated(jacobian, residual, white)
    covariance = with_encoders(white @ meat @ white, solution, white)
    honest = genuine(bread, solution.spurious)
    open_ones = undetermined(names, honest)
    # Spectra from few frequencies scatter; no error is claimed to be smaller than white noise would make it.
    variances = np.maximum(np.diag(covariance), np.diag(white))
    errors = np.sqrt(variances)
    whiteness = errors / np.sqrt(np.diag(white))
    if open_ones:
        errors = np.maximum(errors, np.sqrt(np.diag(covariance_of(honest))))
    low, high = ends(solution, white, errors, ndtri(0.5 + level / 2))
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    unit = np.outer(spread, spread)
    return Certainty(
        names,
        errors,
        np.exp(np.maximum(low, solution.logarithms - WIDEST)),
        np.exp(np.minimum(high, solution.logarithms + WIDEST)),
        covariance,
        np.clip(np.divide(covariance, unit, out=np.eye(len(names)), where=unit > 0), -1, 1),
        honest,
        condition(honest),
        whiteness,
        open_ones,
    )


def genuine(information: np.ndarray, spurious: np.ndarray) -> np.ndarray:
    """Information (p, p) without what the noise of the motors' samples feigns, and something to be safe."""
    return _positive(information - MARGIN * spurious)


def _positive(matrix: np.ndarray) -> np.ndarray:
    """A symmetric matrix (p, p) without the directions in which it is negative."""
    values, vectors = np.linalg.eigh(matrix)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T


def with_encoders(residual: np.ndarray, solution: Solution, white: np.ndarray) -> np.ndarray:
    """Covariance (p, p) of what encoders do to the estimates and of what `residual`, the covariance that the residuals
    show, has beyond that. white: (p, p), the covariance for white noise.

    An encoder errs the same way at the same angle, in every period of a motion. Then its errors look like motion, the
    fit takes them in, and the residuals have few frequencies to tell of it.
    """
    true, seen = np.zeros_like(white), np.zeros_like(white)
    for spectra in solution.fitter.feigned(solution.logarithms, DRAWS):
        moved = white @ sum(np.einsum("fcp,fc->p", j, r) for j, r in zip(solution.jacobians, spectra))
        left = [(j, r - j @ moved) for j, r in zip(solution.jacobians, spectra)]
        true += np.outer(moved, moved) / DRAWS
        seen += white @ sum(correlated(j, r, white) for j, r in left) @ white / DRAWS
    scale = np.sqrt(np.diag(white))
    unit = np.outer(scale, scale)
    return true + _positive((residual - seen) / unit) * unit


def correlated(jacobian: np.ndarray, residual: np.ndarray, white: np.ndarray) -> np.ndarray:
    """sum over frequencies of J^H R J, (p, p), with the spectra R of the residuals averaged over neighbours.

    jacobian (2 b, c, p), residual (2 b, c): real parts above imaginary ones. white: (p, p), the covariance for white
    noise. A frequency counts in the average by its leverage, the share it has in the estimates: with a periodic motion
    all of the quantisation noise is at the motion's own frequencies, and the quiet ones between them say nothing.
    """
    half = len(residual) // 2
    leverage = np.einsum("fcp,pq,fcq->fc", jacobian, white, jacobian, optimize=True)
    # What the parameters have taken of a residual is given back, as a jackknife would (HC3; MacKinnon and White 1985).
    residual = residual / np.maximum(1 - leverage, LEAST_FREEDOM)
    weight = leverage.sum(axis=1)
    weight = (weight[:half] + weight[half:]) ** POWER
    weight += LEAST_WEIGHT * weight.max() + np.finfo(float).tiny
    spectrum = residual[:half] + 1j * residual[half:]
    sensitivity = jacobian[:half] + 1j * jacobian[half:]
    # E |spectrum|^2 is 2 where noise is white and weighted with its strength, but 1 at frequency 0.
    cross = spectrum[:, :, None] * spectrum[:, None, :].conj() / 2
    cross[0] = cross[1]
    window = np.hanning(NEIGHBOURS + 2)[1:-1]
    total = convolve1d(cross * weight[:, None, None], window, axis=0, mode="mirror")
    density = total / convolve1d(weight, window, mode="mirror")[:, None, None]
    # The real part of a complex number of variance R has R / 2, and J^H R J counts both parts.
    return np.einsum("fap,fab,fbq->pq", sensitivity.conj(), density, sensitivity, optimize=True).real


def covariance_of(information: np.ndarray) -> np.ndarray:
    """The inverse of an information matrix; directions without any information get a huge variance, not an error."""
    scale = _scale(information)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    values = np.maximum(values, 1 / WORST_CONDITION)
    return (vectors / values) @ vectors.T / np.outer(scale, scale)


def condition(information: np.ndarray) -> float:
    """Condition of the information matrix scaled to a unit diagonal, at most WORST_CONDITION."""
    scale = _scale(information)
    values = np.linalg.eigvalsh(information / np.outer(scale, scale))
    return float(values[-1] / values[0]) if values[0] * WORST_CONDITION > values[-1] else WORST_CONDITION


def _scale(information: np.ndarray) -> np.ndarray:
    diagonal = np.diag(information)
    return np.sqrt(np.maximum(diagonal, max(1e-24 * diagonal.max(), 1e-30)))


def undetermined(names: Sequence[str], information: np.ndarray) -> List[Combination]:
    """The combinations of parameters whose logarithms the information leaves open, the most uncertain first."""
    values, vectors = np.linalg.eigh(information)
    found = []
    for value, vector in zip(values, vectors.T):
        largest = np.abs(vector).max()
        # The error of the largest parameter when all move along.
        error = largest / np.sqrt(max(value, 1e-30))
        if error > UNDETERMINED:
            vector = vector / vector[np.argmax(np.abs(vector))]
            shares = {name: float(v) for name, v in zip(names, vector) if abs(v) > SHARE}
            found.append(Combination(shares, float(error)))
    return found
