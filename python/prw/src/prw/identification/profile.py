"""Intervals if the model is nonlinear within the uncertainty. For example, from torques only, k1 is uncertain by several
percent, and the data determine it better at the lower end of that range than at the upper one.

An interval ends where the least misfit, over all other parameters, has risen by the square of the quantile (profile
likelihood; Meeker and Escobar, The American Statistician 49 (1995) 48), or by more if noise is not white.
"""

from __future__ import annotations

import numpy as np

from prw.identification.fit import Solution
from prw.motion import Array

#: Standard errors (of the logarithm) below which the model counts as linear, and above which there is no interval.
LINEAR, HOPELESS = 0.01, 1.0
#: Most trials for an end, tolerance of the rise of the misfit's root, and longest step relative to the trial before.
TRIALS, CLOSE, LONGEST = 8, 0.02, 2.0
#: Tolerances of the search over the other parameters.
FOLLOWED = {"ftol": 1e-5, "xtol": 1e-5}


def ends(solution: Solution, white: Array, errors: Array, quantile: float) -> tuple[Array, Array]:
    """Lower and upper ends (p,) of the logarithms' intervals. white: (p, p), the covariance for white noise. errors:
    (p,) standard errors. quantile: of the normal distribution, 1.96 for 95 %."""
    low, high = solution.logarithms - quantile * errors, solution.logarithms + quantile * errors
    for i, error in enumerate(errors):
        if LINEAR < error < HOPELESS:
            # The direction in which the misfit rises least with parameter i.
            step = quantile * error * white[:, i] / white[i, i]
            rise = (quantile * error) ** 2 / white[i, i]
            low[i], high[i] = _end(solution, i, -step, rise), _end(solution, i, step, rise)
    return low, high


def _end(solution: Solution, i: int, step: Array, wanted: float) -> float:
    """Logarithm of parameter i at which the least misfit has risen by `wanted`. step: (p,), the first trial."""
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
