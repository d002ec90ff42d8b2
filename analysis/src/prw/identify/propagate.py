"""What the FMU answers, computed from its linear model for all samples at once.

A run of the FMU through Python costs a few microseconds per communication point and call. The FMU is linear with known
stepping rules (README, "What the motors do between communication points"), and it gives its A, B, C and D itself. The
same numbers follow from a linear recurrence, which numpy does in blocks: with use_omega, over a step of size h from t

    x <- x + B2 (theta(t) - end of the last line)       the jump, B2 being the rate columns of B; none at the start
    x(t + h) = exp(A h) x + integral of exp(A (h - s)) (B1 (theta + omega s) + B2 omega) ds

and y = C x + D u is read before the jump. The tests hold this to the FMU's own runs to rounding.
"""

from __future__ import annotations

from typing import Optional

import numpy as np
from scipy.linalg import expm

from prw.identify.model import Matrices


def outputs(
    model: Matrices,
    h: float,
    theta: np.ndarray,
    omega: np.ndarray,
    every: int = 1,
    state: Optional[np.ndarray] = None,
) -> np.ndarray:
    """The outputs (m, k, 8) of m stacked linear models at every `every`-th of the communication points, k of them.

    h: step in s. theta, omega: (n, 2) motor angles in rad and rates in rad/s at the n communication points, n - 1 a
    multiple of `every`. state: (6,) initial x; default: at rest at the first angles.
    """
    step, drive = _step(model, h)
    jump = np.zeros_like(theta)
    jump[1:] = theta[1:] - (theta[:-1] + h * omega[:-1])
    inputs = np.hstack([theta, omega, jump])
    # `every` steps in one: x(k + every) = step^every x(k) + sum of step^(every-1-j) drive inputs(k+j)
    gains = [drive]
    for _ in range(every - 1):
        gains.append(step @ gains[-1])
    rows = inputs[:-1].reshape(-1, every * inputs.shape[1])
    forced = _apply(np.concatenate(gains[::-1], axis=2), rows)
    start = np.concatenate([theta[0], theta[0], [0.0, 0.0]]) if state is None else np.asarray(state, dtype=float)
    states = recurrence(np.linalg.matrix_power(step, every), forced, start)
    return states @ _transposed(model.C) + _apply(model.D, inputs[::every, :4])


def transients(model: Matrices, h: float, count: int) -> np.ndarray:
    """What each initial state adds to the outputs: C exp(A h k) for k < count, (m, count, 8, 6)."""
    step = expm(model.A * h)
    columns = [
        recurrence(step, np.zeros((len(step), count - 1, 6)), unit) @ _transposed(model.C) for unit in np.eye(6)
    ]
    return np.stack(columns, axis=-1)


def _transposed(matrices: np.ndarray) -> np.ndarray:
    # A transposed view would keep numpy from multiplying with BLAS.
    return np.ascontiguousarray(np.swapaxes(matrices, 1, 2))


def _apply(matrices: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """matrices (m, p, q) times each of rows (n, q), as one product of two matrices: (m, n, p)."""
    m, p, q = matrices.shape
    return (rows @ matrices.reshape(m * p, q).T).reshape(len(rows), m, p).transpose(1, 0, 2)


def _step(model: Matrices, h: float) -> tuple:
    """exp(A h), (m, 6, 6), and what theta, omega and a jump of theta at the start of a step add, (m, 6, 6)."""
    m = len(model.A)
    # x, theta, slope: the exponential of the system together with the motors' straight lines
    generator = np.zeros((m, 10, 10))
    generator[:, :6, :6], generator[:, :6, 6:] = model.A, model.B
    generator[:, 6, 8] = generator[:, 7, 9] = 1.0
    flow = expm(generator * h)
    step = flow[:, :6, :6]
    return step, np.concatenate([flow[:, :6, 6:], step @ model.B[:, :, 2:]], axis=2)


def recurrence(step: np.ndarray, forced: np.ndarray, start: np.ndarray) -> np.ndarray:
    """x[k + 1] = step x[k] + forced[k] from x[0] = start, for m systems. step (m, s, s), forced (m, n, s), start (s,).

    Returns (m, n + 1, s). Blocks of steps run side by side; then what each starts with is handed on.
    """
    m, n, s = forced.shape
    length = max(1, int(np.sqrt(n) / 2))
    blocks = -(-n // length)
    table = np.zeros((m, blocks * length, s))
    table[:, :n] = forced
    # position in the block first: each of its slices is contiguous
    table = np.ascontiguousarray(table.reshape(m, blocks, length, s).transpose(2, 0, 1, 3))
    across = _transposed(step)
    powers = np.empty((length, m, s, s))
    powers[0] = across
    for j in range(1, length):
        table[j] += table[j - 1] @ across
        powers[j] = powers[j - 1] @ across
    carry = np.empty((m, blocks, s))
    state = np.broadcast_to(start, (m, s))
    for b in range(blocks):
        carry[:, b] = state
        state = table[-1, :, b] + (state[:, None] @ powers[-1])[:, 0]
    table += carry @ powers
    result = np.empty((m, n + 1, s))
    result[:, 0] = start
    result[:, 1:] = table.transpose(1, 2, 0, 3).reshape(m, blocks * length, s)[:, :n]
    return result
