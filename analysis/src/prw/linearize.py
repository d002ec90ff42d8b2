"""The linear model of an FMU, from its directional derivatives."""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path
from typing import Dict, Iterator, Mapping, NamedTuple, Optional, Sequence, Tuple

import fmpy
import numpy as np
from fmpy.simulation import apply_start_values, instantiate_fmu, settable_in_instantiated

from prw.columns import ANGLES, RATES
from prw.errors import UserError


class LinearModel(NamedTuple):
    """x' = A x + B u, y = C x + D u, eq. (11), with the names and units of x, u and y.

    A: (n, n), B: (n, m), C: (p, n), D: (p, m), in the FMU's units. states, inputs, outputs: the names of x (n), u (m)
    and y (p). units: unit by name, "" where there is none. rates: which input is the rate of which (omega1 of theta1).
    Unpacks as `A, B, C, D, *names = linearize(fmu)`.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    states: Tuple[str, ...]
    inputs: Tuple[str, ...]
    outputs: Tuple[str, ...]
    units: Dict[str, str]
    rates: Dict[str, str]

    def transfer(self, s) -> np.ndarray:
        """The transfer matrix G(s) = C (s 1 - A)^-1 B + D, eq. (13), for s (k,) in 1/s. Complex, (k, p, m)."""
        s = np.atleast_1d(np.asarray(s, dtype=complex))
        pencil = s[:, None, None] * np.eye(len(self.states)) - self.A
        return self.C @ np.linalg.solve(pencil, np.broadcast_to(self.B, (len(s), *self.B.shape))) + self.D

    def motion_transfer(self, s) -> np.ndarray:
        """The transfer matrix from the inputs alone that are nobody's rate, each one moving together with its rate:
        G's column of theta1 plus s times its column of omega1. Rows theta3 ... theta6 of it are H(s), eq. (15).

        s: (k,) in 1/s. Complex, (k, p, number of such inputs); their names are `motions`.
        """
        s = np.atleast_1d(np.asarray(s, dtype=complex))
        whole = dict(zip(self.inputs, np.moveaxis(self.transfer(s), 2, 0)))
        columns = {name: whole[name] for name in self.motions}
        for rate, name in self.rates.items():
            columns[name] = columns[name] + s[:, None] * whole[rate]
        return np.stack(list(columns.values()), axis=2)

    @property
    def motions(self) -> Tuple[str, ...]:
        """The inputs that are nobody's rate."""
        return tuple(name for name in self.inputs if name not in self.rates)

    def to_control(self):
        """The same as a control.StateSpace with the signals' names. Raises UserError without the package `control`."""
        try:
            import control
        except ImportError:
            raise UserError("python-control is not installed; add it with `pip install control`") from None
        return control.ss(
            self.A,
            self.B,
            self.C,
            self.D,
            states=list(self.states),
            inputs=list(self.inputs),
            outputs=list(self.outputs),
        )


def linearize(
    fmu: Path,
    outputs: Optional[Sequence[str]] = None,
    start_values: Optional[Mapping[str, object]] = None,
    fmi_type: Optional[str] = None,
) -> LinearModel:
    """The linear model of the FMI 2.0 file `fmu` at its initial state, by fmi2GetDirectionalDerivative.

    outputs: names of y, outputs or states (default: the FMU's Real outputs). start_values: parameters and
    inputs by name (default: the FMU's own); the testbed is linear, so of these only parameters matter. fmi_type:
    "CoSimulation" or "ModelExchange" (default: what the FMU offers, in this order).

    Raises UserError where the FMU is missing, has no directional derivatives, lacks a name or refuses a value.
    """
    fmu = Path(fmu)
    if not fmu.is_file():
        raise UserError(f"{fmu}: no such FMU; `make fmu` builds it")
    try:
        description = fmpy.read_model_description(str(fmu))
    except Exception as error:  # FMPy raises bare Exceptions
        raise UserError(f"{fmu}: cannot be read ({error})") from None
    interfaces = {"CoSimulation": description.coSimulation, "ModelExchange": description.modelExchange}
    chosen = fmi_type or next(name for name, interface in interfaces.items() if interface is not None)
    if description.fmiVersion != "2.0" or not getattr(interfaces.get(chosen), "providesDirectionalDerivative", False):
        raise UserError(f"{fmu}: offers no directional derivatives of FMI 2.0 for {chosen}")

    variables = {v.name: v for v in description.modelVariables}
    derivatives = {d.variable.derivative.name: d.variable.name for d in description.derivatives}
    states = tuple(derivatives)
    inputs = tuple(name for name, v in variables.items() if (v.causality, v.type) == ("input", "Real"))
    known = [o.variable.name for o in description.outputs if o.variable.type == "Real"]
    outputs = tuple(known if outputs is None else outputs)
    for name in outputs:
        if name not in known and name not in derivatives:
            choice = ", ".join(dict.fromkeys([*known, *states]))
            raise UserError(f"{fmu}: {name} is neither a Real output nor a state; there are {choice}")

    with _initialized(fmu, description, chosen, start_values or {}) as instance:

        def partials(unknowns: Sequence[str], knowns: Sequence[str]) -> np.ndarray:
            """d unknown / d known, (number of unknowns, number of knowns); one call for each known."""
            rows = [variables[name].valueReference for name in unknowns]
            columns = [instance.getDirectionalDerivative(rows, [variables[k].valueReference], [1.0]) for k in knowns]
            return np.array(columns).reshape(len(knowns), len(rows)).T

        rates = tuple(derivatives.values())
        A, B = partials(rates, states), partials(rates, inputs)
        # A state is no unknown of FMI's directional derivatives, and its row of C needs none.
        C = np.array([[float(name == state) for state in states] for name in outputs]).reshape(-1, len(states))
        D = np.zeros((len(outputs), len(inputs)))
        calculated = [row for row, name in enumerate(outputs) if name not in derivatives]
        if calculated:
            unknowns = [outputs[row] for row in calculated]
            C[calculated], D[calculated] = partials(unknowns, states), partials(unknowns, inputs)

    units = {name: _unit(variables[name]) for name in (*states, *inputs, *outputs)}
    rate_of = {rate: angle for rate, angle in zip(RATES, ANGLES) if {rate, angle} <= set(inputs)}
    return LinearModel(A, B, C, D, states, inputs, outputs, units, rate_of)


@contextlib.contextmanager
def _initialized(fmu: Path, description, fmi_type: str, start_values: Mapping[str, object]) -> Iterator:
    """An FMPy instance of the FMU after initialization; what it refuses becomes a UserError with what it logged."""
    complaints = []

    def hear(_environment, _instance, _status, _category, message) -> None:
        complaints.append((message or b"").decode("utf-8", "replace").strip())

    folder, instance = fmpy.extract(str(fmu)), None
    try:
        instance = instantiate_fmu(folder, description, fmi_type=fmi_type, logger=hear)
        instance.setupExperiment()
        left = apply_start_values(instance, description, dict(start_values), settable_in_instantiated)
        if left:
            raise UserError(f"{fmu}: no start value {', '.join(left)}")
        instance.enterInitializationMode()
        instance.exitInitializationMode()
        yield instance
        instance.terminate()
    except UserError:
        raise
    except Exception as error:  # FMPy raises bare Exceptions
        raise UserError(f"{fmu}: cannot be linearized ({complaints[-1] if complaints else error})") from None
    finally:
        if instance is not None:
            instance.freeInstance()
        shutil.rmtree(folder, ignore_errors=True)


def _unit(variable) -> str:
    return variable.unit or getattr(variable.declaredType, "unit", None) or ""
