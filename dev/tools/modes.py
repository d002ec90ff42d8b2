"""The two modes of the mirror-symmetric testbed, pitch and roll, with their poles and zeros."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from prw.state_space import StateSpace

#: The three pairs of mirrored states.
PAIRS = (("theta3", "theta4"), ("theta5", "theta6"), ("omega5", "omega6"))


class Mode(NamedTuple):
    """Pitch or roll: x' = A x + b theta + b_rate theta', angle = c x.

    x is half the sum (pitch) or half the difference (roll) of each pair of states, and theta likewise of the motors' angles,
    rad. A is (3, 3); b, b_rate and c are (3,). `mixing` is the largest coupling to the other mode that is left in A and B;
    symmetry makes it zero.
    """

    A: np.ndarray
    b: np.ndarray
    b_rate: np.ndarray
    c: np.ndarray
    mixing: float

    def poles(self) -> np.ndarray:
        """The eigenvalues of A, (3,), 1/s."""
        return np.linalg.eigvals(self.A)

    def zeros(self) -> np.ndarray:
        """The zeros from motor angle (whose rate follows) to the mode's angle, 1/s.

        With x = z + b_rate theta the rate leaves the input: z' = A z + (b + A b_rate) theta, and c b_rate = 0. The
        numerator of c (s 1 - A)^-1 b is det(s 1 - A + b c) - det(s 1 - A).
        """
        b = self.b + self.A @ self.b_rate
        numerator = np.poly(self.A - np.outer(b, self.c)) - np.poly(self.A)
        # Leading coefficients that are rounding errors are set to zero: there are fewer zeros than poles.
        numerator[np.abs(numerator) < 1e-9 * np.abs(np.poly(self.A))] = 0
        return np.roots(np.trim_zeros(numerator, "f"))


def pitch_and_roll(model: StateSpace) -> tuple[Mode, Mode]:
    """Split the linear model of the testbed, whose outputs include pitch and roll, into its two modes."""
    order = [model.states.index(name) for pair in PAIRS for name in pair]
    motors = [model.inputs.index(name) for name in ("theta1", "theta2", "omega1", "omega2")]
    # Sum and difference of the sides of each pair; the inverse of [1 1; 1 -1]/2 is [1 1; 1 -1].
    half, whole = (np.kron(np.eye(3), scale * np.array([[1, 1], [1, -1]])) for scale in (0.5, 1.0))
    A = half @ model.A[np.ix_(order, order)] @ whole
    B = half @ model.B[np.ix_(order, motors)] @ whole[:4, :4]
    modes = []
    for mode, output in enumerate(("pitch", "roll")):
        rows, others = slice(mode, 6, 2), slice(1 - mode, 6, 2)
        mixing = max(np.abs(A[rows, others]).max(), np.abs(B[rows, 1 - mode :: 2]).max())
        c = (model.C[model.outputs.index(output)][order] @ whole)[rows]
        modes.append(Mode(A[rows, rows], B[rows, mode], B[rows, 2 + mode], c, float(mixing)))
    return modes[0], modes[1]
