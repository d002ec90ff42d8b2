"""Exact and independently integrated responses of the testbed, with which the FMU is compared.

`follow` is exact for motor angles that are linear between communication points, with jumps allowed at the points. It
exponentiates the system augmented by the motion of the motors, in doubles (scipy) or to any precision (mpmath).
`integrate` takes any smooth motion of the motors and uses scipy's DOP853. The two functions share only the linear model.
"""

from __future__ import annotations

import mpmath
import numpy as np
from lagrange import OUTPUTS, LinearModel
from scipy.integrate import solve_ivp
from scipy.linalg import expm


def at_rest(theta) -> np.ndarray:
    """Returns the state x (6,) of the testbed at rest with the motors at the angles theta (2,) in rad."""
    return np.array([theta[0], theta[1], theta[0], theta[1], 0 * theta[0], 0 * theta[1]])


def augmented(model: LinearModel) -> np.ndarray:
    """Returns g (10, 10) in z' = g z, with z = (x, theta, slope), while the motors turn at the constant rate `slope`."""
    g = np.zeros((10, 10), dtype=model.a.dtype) + model.a[0, 0] * 0
    g[:6, :6], g[:6, 6:8], g[:6, 8:10] = model.a, model.b_angle, model.b_rate
    g[6, 8] = g[7, 9] = g[6, 8] + 1
    return g


def exponential(g: np.ndarray) -> np.ndarray:
    """Returns exp(g), calculated by mpmath for arrays of objects and by scipy for doubles."""
    if g.dtype == object:
        return np.array(mpmath.expm(mpmath.matrix(g.tolist()), method="taylor").tolist(), dtype=object)
    return expm(g)


def follow(model: LinearModel, t, theta, slope, x0=None):
    """Returns exact outputs if the motors follow theta[k] + slope[k] (s - t[k]) on each [t[k], t[k+1]].

    t (n,) in s, theta (n, 2) in rad, slope (n, 2) in rad/s; x0 (6,) defaults to rest at theta[0]. If the path
    does not end at the next theta, the angles jump, which is an impulse on the testbed. There is no jump at t[0].

    Returns (at, after), dicts of arrays by output name. `at` has the n values at t[k], with theta[k] and slope[k] but
    without the effect of the jump, which belongs to the next step. `after` has the n - 1 values at the end of each step.
    """
    g, powers = augmented(model), {}
    x = at_rest(theta[0]) if x0 is None else np.asarray(x0)
    at, after = [], []
    path = None
    for k in range(len(t)):
        at.append(model.outputs(x, theta[k], slope[k]))
        if k == len(t) - 1:
            break
        if path is not None:
            x = x + model.impulse(theta[k] - path)
        h = t[k + 1] - t[k]
        if h not in powers:
            powers[h] = exponential(g * h)
        z = powers[h] @ np.concatenate([x, theta[k], slope[k]])
        x, path = z[:6], z[6:8]
        after.append(model.outputs(x, path, slope[k]))
    return _columns(at), _columns(after)


def integrate(model: LinearModel, t, theta, rate, x0=None, breaks=()):
    """Returns outputs at the times t (n,) if the motors follow the functions theta(s) -> (2,) rad, rate(s) -> (2,) rad/s.

    The relative tolerance is 1e-12. `breaks` are times where the motion is not smooth; the integration restarts there.
    """
    t = np.asarray(t, dtype=float)
    x = at_rest(np.asarray(theta(t[0]))) if x0 is None else np.asarray(x0, dtype=float)
    edges = [t[0], *[b for b in breaks if t[0] < b < t[-1]], t[-1]]
    states = np.empty((len(t), 6))
    for a, b in zip(edges, edges[1:]):
        inside = (t >= a) & (t <= b)
        solution = solve_ivp(
            lambda s, y: model.a @ y + model.b_angle @ theta(s) + model.b_rate @ rate(s),
            (a, b),
            x,
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
            dense_output=False,
            t_eval=np.union1d(t[inside], [b]),
            max_step=(b - a) / 8,
        )
        assert solution.success, solution.message
        states[inside] = solution.y.T[: inside.sum()]
        x = solution.y[:, -1]
    return _columns([model.outputs(xk, np.asarray(theta(s)), np.asarray(rate(s))) for xk, s in zip(states, t)])


def backward_slope(t, theta) -> np.ndarray:
    """Returns slopes (n, 2) that follow from samples: at t[k], the slope of the parabola through the last three samples.

    The slope at the first sample is 0; at the second sample it is the slope of a straight line. Uses Lagrange polynomials.
    """
    slope = np.zeros_like(theta)
    for k in range(1, len(t)):
        nodes = range(max(0, k - 2), k + 1)
        for i in nodes:
            others = [j for j in nodes if j != i]
            scale = np.prod([t[i] - t[j] for j in others])
            if i == k:
                weight = sum(np.prod([t[k] - t[j] for j in others if j != m]) for m in others) / scale
            else:
                weight = np.prod([t[k] - t[j] for j in others if j != k]) / scale
            slope[k] += weight * theta[i]
    return slope


def _columns(rows):
    return {name: np.array([row[name] for row in rows]) for name in OUTPUTS}
