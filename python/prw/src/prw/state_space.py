"""A linear model with the names of its states, inputs and outputs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from prw.arguments import floats_of
from prw.errors import UserError, need
from prw.motion import Array

if TYPE_CHECKING:
    import control
    import scipy.signal

Complex = NDArray[np.complex128]


@dataclass(frozen=True, repr=False)
class StateSpace:
    """x' = A x + B u, y = C x + D u.

    Attributes
    ----------
    A, B, C, D
        (n, n), (n, m), (p, n) and (p, m), in the FMU's units.
    states, inputs, outputs
        The names of x (n), u (m) and y (p).
    units
        Unit by name; "" if there is none.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: Mapping[str, str]

    def poles(self) -> Complex:
        """The eigenvalues of A, (n,), 1/s."""
        return np.linalg.eigvals(self.A).astype(np.complex128)

    def transfer(self, s: ArrayLike, rates: Mapping[str, str] | None = None) -> Complex:
        """The transfer matrix C (s 1 - A)^-1 B + D, for s (k,) in 1/s: complex, (k, p, m).

        rates: inputs that are the derivative of another input, by name: {"omega1": "theta1"}. Each of their columns is
        multiplied by s, added to the column of the other input, and then left out; see `moved`. Raises UserError for
        names that are not inputs.
        """
        s = np.atleast_1d(np.asarray(s, dtype=np.complex128))
        kept = [self.inputs.index(name) for name in self.moved(rates or {})]
        columns = {self.inputs.index(rate): self.inputs.index(angle) for rate, angle in (rates or {}).items()}
        pencil = s[:, None, None] * np.eye(len(self.states)) - self.A
        whole = self.C @ np.linalg.solve(pencil, np.broadcast_to(self.B, (len(s), *self.B.shape))) + self.D
        for rate, angle in columns.items():
            whole[:, :, angle] += s[:, None] * whole[:, :, rate]
        return np.ascontiguousarray(whole[:, :, kept], dtype=np.complex128)

    def moved(self, rates: Mapping[str, str]) -> tuple[str, ...]:
        """The inputs that are not among `rates`: the columns of `transfer` and `response_at_hz`. Raises UserError for names that are
        not inputs, and for an input that is both a rate and the input of which another one is the rate."""
        for name in (*rates, *rates.values()):
            if name not in self.inputs:
                raise UserError(f"{name} is not an input; there are {', '.join(self.inputs)}", argument="rates")
        for rate, angle in rates.items():
            if angle in rates:
                raise UserError(f"{angle}, whose rate is {rate}, is a rate itself", argument="rates")
        return tuple(name for name in self.inputs if name not in rates)

    def response_at_hz(self, frequency: ArrayLike, rates: Mapping[str, str] | None = None) -> Complex:
        """The response to sines, for frequencies (k,) in Hz: complex amplitudes of outputs per input, (k, p, m).
        rates: as for `transfer`. For frequencies in rad/s, use `transfer(1j * omega)`, or python-control with
        `to_control().frequency_response(omega)`."""
        return self.transfer(2j * np.pi * np.atleast_1d(floats_of("frequency", frequency)), rates)

    def to_control(self) -> control.StateSpace:
        """Convert to python-control, with the signals' names. Raises UserError without the package `control`."""
        need("control")
        import control

        names = {"states": list(self.states), "inputs": list(self.inputs), "outputs": list(self.outputs)}
        return control.ss(self.A, self.B, self.C, self.D, **names)

    def to_scipy(self) -> scipy.signal.StateSpace:
        """Convert to scipy.signal, without names. Raises UserError without the package `scipy`."""
        need("scipy")
        import scipy.signal

        return scipy.signal.StateSpace(self.A, self.B, self.C, self.D)

    def __repr__(self) -> str:
        names = f"x = {', '.join(self.states)}; u = {', '.join(self.inputs)}; y = {', '.join(self.outputs)}"
        return f"<StateSpace of {len(self.states)} states: {names}>"
