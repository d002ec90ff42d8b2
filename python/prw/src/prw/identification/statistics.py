"""Standard errors of the estimates, and combinations of parameters that the data do not determine.

The covariance of the estimates is H^-1 S H^-1: H is the information of the data and the priors, and S the variance of
the score J'r, with residuals r and their Jacobian J. One S assumes white sensor noise, and simulates the effect of
encoder errors on the score with random draws (parametric bootstrap; Efron and Tibshirani 1993, Sec. 6.5). The other S is
the sum over frequencies of the squares of the actual scores, which holds for noise of any colour (White, Econometrica 48
(1980) 817, in the form HC3 of MacKinnon and White, J. Econometrics 29 (1985) 305). The larger of the two errors counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from prw.identification.fit import Comparison, Solution
from prw.motion import Array

#: Standard errors of a logarithm. Below LINEAR the model counts as linear, and above HOPELESS no profile likelihood is
#: calculated.
LINEAR, HOPELESS = 0.01, 1.0
#: TRIALS: maximum number of trials for an end of an interval. CLOSE: relative tolerance of the step. LONGEST: maximum
#: ratio of two steps.
TRIALS, CLOSE, LONGEST = 8, 0.02, 2.0
#: Tolerances of the search over the other parameters.
FOLLOWED = {"ftol": 1e-5, "xtol": 1e-5}


def ends(solution: Solution, inverse: Array, errors: Array, quantile: float) -> tuple[Array, Array]:
    """Lower and upper ends (p,) of the unknowns' intervals. inverse: (p, p), of the information. errors: (p,) standard
    errors. quantile: of the normal distribution, 1.96 for 95 %."""
    low, high = solution.logarithms - quantile * errors, solution.logarithms + quantile * errors
    for i, error in enumerate(errors):
        if LINEAR < error < HOPELESS:
            # The direction in which the misfit rises least with parameter i.
            step = quantile * error * inverse[:, i] / inverse[i, i]
            rise = (quantile * error) ** 2 / inverse[i, i]
            low[i], high[i] = _end(solution, i, -step, rise), _end(solution, i, step, rise)
    return low, high


def _end(solution: Solution, i: int, step: Array, wanted: float) -> float:
    """Logarithm of parameter i at which the misfit, minimized over the other parameters, has risen by `wanted`. step:
    (p,), the first trial."""
    centre, (low, high) = solution.logarithms, solution.task.span()
    for _ in range(TRIALS):
        point = np.clip(centre + step, low, high)
        found = solution.fitter.search(point, FOLLOWED, held=i)
        point, rise = found.x, 2 * found.cost - solution.misfit
        further = np.sqrt(wanted / rise) if rise > wanted / LONGEST**2 else LONGEST
        if abs(further - 1) < CLOSE or (point[i] in (low[i], high[i]) and further > 1):
            break
        step = (point - centre) * max(further, 1 / LONGEST)
    return float(point[i])


#: Largest condition number; larger ones would be rounding errors only.
WORST_CONDITION = 1e15
#: Largest distance of an interval's end from the estimate, as a logarithm; larger ones overflow.
WIDEST = 600.0
#: Least value of 1 - leverage by which a residual is divided.
LEAST_FREEDOM = 0.1
#: A combination of parameters that is uncertain by more than this fraction (one sigma) counts as not determined.
UNDETERMINED = 0.3
#: This multiple of the encoders' contribution is subtracted from the information.
MARGIN = 3.0
#: Least share of a parameter that is named in a combination.
SHARE = 0.15


class Combination(NamedTuple):
    """A direction in the space of parameters that the data do not determine.

    Attributes
    ----------
    shares
        Exponents by parameter, the largest of magnitude 1: the parameters can change together like p -> p * x^share.
    error
        Standard deviation of log x.
    """

    shares: Mapping[str, float]
    error: float

    def __str__(self) -> str:
        moves = ", ".join(f"{name} {(1.1**share - 1) * 100:+.0f} %" for name, share in self.shares.items())
        if len(self.shares) == 1:
            return f"{next(iter(self.shares))} has hardly any effect on the measurements"
        names = list(self.shares)
        return (
            f"{', '.join(names[:-1])} and {names[-1]} cannot be distinguished: "
            f"changing them together by {moves} has hardly any effect on the measurements"
        )


class Certainty(NamedTuple):
    """Standard errors and intervals of the p unknowns: parameters, then distortions.

    Attributes
    ----------
    names
        Names of the unknowns.
    relative
        (p,), standard errors of the unknowns. For a parameter or a gain the unknown is the logarithm, so its error is a
        fraction of the value; for a delay or a lag it is the value in ms.
    low, high
        (p,) each, exponentials of the ends of the unknowns' 95 % intervals; for parameters, the ends in SI.
    correlation
        (p, p), correlation of the estimates.
    information
        (p, p), Fisher information about the logarithms, with the priors, minus MARGIN times the encoders' contribution.
    condition
        Condition number of the information, scaled to a unit diagonal.
    whiteness
        (p,), factor by which correlation of the noise makes the standard errors larger than for white noise.
    undetermined
        Combinations that the data do not determine.
    """

    names: Sequence[str]
    relative: Array
    low: Array
    high: Array
    correlation: Array
    information: Array
    condition: float
    whiteness: Array
    undetermined: list[Combination]


def certainty(solution: Solution, widening: Array) -> Certainty:
    """Standard errors, correlation, intervals and undetermined combinations of a fit. widening: (p,), standard
    deviations of the unknowns due to possible faults, which are added to the standard errors in quadrature."""
    names, prior = solution.task.unknowns, solution.task.prior_information()
    squares = prior + information_of(solution.jacobians)
    inverse = covariance_of(_positive(squares - solution.noise_information))
    expected, shown = prior.copy(), prior.copy()
    for comparison, jacobian in zip(solution.comparisons, solution.jacobians):
        expected += comparison.score_variance(jacobian)
        shown += scores(comparison, jacobian, inverse)
    expected, shown = inverse @ expected @ inverse, inverse @ shown @ inverse
    # If a combination is undetermined, rounding errors make some variances negative.
    scale = np.sqrt(np.maximum(np.diag(expected), np.finfo(float).tiny))
    errors = np.maximum(np.sqrt(np.maximum(np.diag(shown), 0.0)), scale)
    whiteness = errors / scale
    corrected = noise_corrected(squares, solution.noise_information)
    open_ones = undetermined(names, corrected)
    # If a combination is undetermined, the corrected information gives the full uncertainty, and the widening is left out.
    errors = np.hypot(errors, 0.0 if open_ones else widening)
    if open_ones:
        errors = np.maximum(errors, np.sqrt(np.diag(covariance_of(corrected))))
    low, high = ends(solution, inverse, errors, float(ndtri(0.975)))
    unit = np.outer(scale, scale)
    # The variance of an undetermined combination may consist of rounding errors only, so quotients are clipped.
    with np.errstate(over="ignore"):
        correlation = np.clip(np.divide(expected, unit, out=np.eye(len(names)), where=unit > 0), -1, 1)
    return Certainty(
        names,
        errors,
        np.exp(np.maximum(low, solution.logarithms - WIDEST)),
        np.exp(np.minimum(high, solution.logarithms + WIDEST)),
        correlation,
        corrected,
        condition(corrected),
        whiteness,
        open_ones,
    )


def information_of(jacobians: Sequence[Array]) -> Array:
    """J'J (p, p) of Jacobians (2, bins, c, p)."""
    flat = np.vstack([jacobian.reshape(-1, jacobian.shape[-1]) for jacobian in jacobians])
    information: Array = flat.T @ flat
    return information


def scores(comparison: Comparison, jacobian: Array, inverse: Array) -> Array:
    """Sum (p, p) over the frequencies of the outer product of each frequency's score J'r with itself. inverse: (p, p),
    of the information."""
    # Residuals are divided by 1 - leverage, as in a jackknife.
    leverage = np.einsum("rfcp,pq,rfcq->rfc", jacobian, inverse, jacobian, optimize=True)
    residual = comparison.residual / np.maximum(1 - leverage, LEAST_FREEDOM)
    each = np.einsum("rfcp,rfc->fp", jacobian, residual)
    total: Array = each.T @ each
    return total


def noise_corrected(information: Array, noise: Array) -> Array:
    """Information (p, p) minus MARGIN times the encoders' contribution `noise` (p, p), without negative directions."""
    return _positive(information - MARGIN * noise)


def _positive(matrix: Array) -> Array:
    """A symmetric matrix (p, p) without the directions in which it is negative."""
    values, vectors = np.linalg.eigh(matrix)
    positive: Array = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return positive


def covariance_of(information: Array) -> Array:
    """The inverse of an information matrix. A direction without any information gets a huge variance; no exception is
    raised."""
    scale = _scale(information)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    values = np.maximum(values, 1 / WORST_CONDITION)
    inverse: Array = (vectors / values) @ vectors.T / np.outer(scale, scale)
    return inverse


def condition(information: Array) -> float:
    """Condition of the information matrix scaled to a unit diagonal, at most WORST_CONDITION."""
    scale = _scale(information)
    values = np.linalg.eigvalsh(information / np.outer(scale, scale))
    return float(values[-1] / values[0]) if values[0] * WORST_CONDITION > values[-1] else WORST_CONDITION


def _scale(information: Array) -> Array:
    diagonal = np.diag(information)
    return np.sqrt(np.maximum(diagonal, max(1e-24 * diagonal.max(), 1e-30)))


def undetermined(names: Sequence[str], information: Array) -> list[Combination]:
    """The combinations of parameters whose logarithms the information does not determine, the most uncertain first."""
    values, vectors = np.linalg.eigh(information)
    found = []
    for value, vector in zip(values, vectors.T):
        largest = np.abs(vector).max()
        # The error of the parameter with the largest share, if the others change with it.
        error = largest / np.sqrt(max(value, 1e-30))
        if error > UNDETERMINED:
            vector = vector / vector[np.argmax(np.abs(vector))]
            shares = {name: float(v) for name, v in zip(names, vector) if abs(v) > SHARE}
            found.append(Combination(shares, float(error)))
    return found
