"""The linear model of an FMU, from its directional derivatives."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from numbers import Real
from typing import Any, Literal, Self

import fmu_run
import numpy as np

from prw.arguments import Given, names_of, values_of
from prw.errors import UserError, of_fmu
from prw.state_space import StateSpace
from prw.testbed import CONTINUOUS, existing_fmu, loaded

#: With these start values of the testbed, its states and inputs are independent of each other in Co-Simulation.
#: Otherwise a motor angle also changes the rate that is estimated from it and, before the first step, the states.
INDEPENDENT = {"use_omega": True, "start_at_rest": False}
Interface = Literal["co-simulation", "model-exchange"]
INTERFACES = {"CoSimulation": "Co-Simulation", "ModelExchange": "Model Exchange"}
#: The names of the interface types in `fmu_run`.
FMU_RUN_NAMES: dict[str, Interface] = {"CoSimulation": "co-simulation", "ModelExchange": "model-exchange"}


def linearize(
    parameters: Given = None,
    *,
    fmu: str | os.PathLike[str] | None = None,
    outputs: str | Iterable[str] | None = None,
    fmi_type: str | None = None,
) -> StateSpace:
    """The linear model of any FMU of FMI 2.0 or 3.0 that has directional derivatives, at its initial state.

    Parameters
    ----------
    parameters
        Start values of parameters, states and inputs by name, in the FMU's units or with a unit as in (1.9, "N.m/deg"),
        or the path of a JSON file that `prw identify` has written. Other variables keep their start values. The testbed
        is linear, so only parameters matter there. `use_omega` is set to true and `start_at_rest` to false if they are
        not given: A, B, C and D are then the matrices of eq. (11), with the motors' angles and rates as independent
        inputs. With `use_omega` false, Co-Simulation estimates the rates from the angles and ignores `omega1` and
        `omega2`.
    fmu
        The FMU (default: the testbed's).
    outputs, fmi_type
        As for `Linearizer`, which is faster for many models of one FMU.

    Raises
    ------
    UserError
        The FMU is missing, has no directional derivatives, lacks a variable or rejects a value.
    """
    with Linearizer(fmu, outputs=outputs, fmi_type=fmi_type) as linearizer:
        return linearizer.at(parameters)


class Linearizer:
    """Linear models of one FMU, which is loaded only once: call `at(parameters)` as often as needed. A context
    manager; leaving it unloads the FMU.

    The testbed's `use_omega` and `start_at_rest` are set as for `linearize`.

    Parameters
    ----------
    fmu
        The FMU (default: the testbed's).
    outputs
        Names of y, outputs or states (default: the FMU's continuous outputs).
    fmi_type
        "CoSimulation" or "ModelExchange" (default: the first of them that has directional derivatives).

    Raises
    ------
    UserError
        As for `linearize`.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __init__(
        self,
        fmu: str | os.PathLike[str] | None = None,
        *,
        outputs: str | Iterable[str] | None = None,
        fmi_type: str | None = None,
    ):
        self.fmu = existing_fmu(fmu)
        self.loaded = loaded(self.fmu)
        try:
            self._select(outputs, fmi_type)
        except UserError:
            self.loaded.close()
            raise

    def _select(self, outputs: str | Iterable[str] | None, fmi_type: str | None) -> None:
        """Select the states, inputs and outputs of the model. Raises UserError."""
        loaded, variables = self.loaded, self.loaded.variables
        self._interface = FMU_RUN_NAMES[self._chosen(fmi_type)]
        self.states = tuple(loaded.derivatives)
        self.inputs = tuple(v.name for v in variables.values() if v.causality == "input" and v.type in CONTINUOUS)
        self.outputs = loaded.outputs if outputs is None else names_of("outputs", outputs)
        for name in self.outputs:
            if name not in loaded.outputs and name not in self.states:
                choice = ", ".join(dict.fromkeys([*loaded.outputs, *self.states]))
                raise UserError(f"{self.fmu}: {name} is neither a continuous output nor a state; there are {choice}")
        # FMI does not allow states as unknowns of directional derivatives. Their rows of C are known.
        self._calculated = [row for row, name in enumerate(self.outputs) if name not in self.states]
        self._unknowns = (*loaded.derivatives.values(), *(self.outputs[row] for row in self._calculated))
        self._knowns = (*self.states, *self.inputs)
        self._units = {name: variables[name].unit or "" for name in (*self._knowns, *self.outputs)}
        self._instance: fmu_run.Instances | None = None
        self._given: set[str] = set()
        self._closed = False

    def at(self, parameters: Given = None) -> StateSpace:
        """The linear model for the start values `parameters`, as for `linearize`. Raises UserError for a name that the
        FMU lacks or a value that it rejects."""
        if self._closed:
            raise UserError(f"{self.fmu}: is closed")
        given = values_of(parameters, self.loaded)
        start = {name: value for name, value in INDEPENDENT.items() if self._has_flag(name)}
        start |= {name: self._start(name, value) for name, value in given.items()}
        table = np.zeros((len(self._knowns), len(self._unknowns)))
        try:
            instance = self._initialized(start)
            if self._unknowns:
                for number, known in enumerate(self._knowns):
                    table[number] = instance.directional_derivative(self._unknowns, known, 1.0)[0]
        except (fmu_run.FmuError, ValueError) as error:
            self._instance = None
            raise UserError(f"{self.fmu}: cannot be linearized ({of_fmu(str(error))})") from None
        n = len(self.states)
        whole = np.zeros((len(self.outputs), len(self._knowns)))
        whole[self._calculated] = table.T[n:]
        for row, name in enumerate(self.outputs):
            if name in self.states:
                whole[row, self.states.index(name)] = 1.0
        slope = table.T[:n]
        A, B, C, D = (np.ascontiguousarray(m) for m in (slope[:, :n], slope[:, n:], whole[:, :n], whole[:, n:]))
        return StateSpace(A, B, C, D, self.states, self.inputs, self.outputs, self._units)

    def close(self) -> None:
        """Free the instance, unload the library and remove the unpacked files. Harmless when called again."""
        self._closed, self._instance = True, None
        self.loaded.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _chosen(self, wanted: str | None) -> str:
        """The interface type to use. Raises UserError if the FMU has no directional derivatives for it."""
        offers = self.loaded.directional
        directional = {name: offers[other] for name, other in FMU_RUN_NAMES.items() if other in offers}
        attribute = "providesDirectionalDerivative" + ("" if self.loaded.fmi_version == "2.0" else "s")
        able = [name for name, offered in directional.items() if offered]
        if wanted is None and able:
            return able[0]
        if wanted in able:
            return str(wanted)
        which = INTERFACES.get(wanted, wanted) if wanted else " or ".join(INTERFACES[name] for name in directional)
        other = f"; it does for {' and '.join(INTERFACES[name] for name in able)}" if able else ""
        raise UserError(f"{self.fmu}: offers no directional derivatives for {which} ({attribute} is not true){other}")

    def _has_flag(self, name: str) -> bool:
        variable = self.loaded.variables.get(name)
        return variable is not None and (variable.causality, variable.type) == ("parameter", "Boolean")

    def _start(self, name: str, value: Any) -> Any:
        """Returns the value if it is a string for a String, or a number for another type. Raises UserError otherwise, or if there
        is no such variable."""
        variables = self.loaded.variables
        if name not in variables:
            settable = [v.name for v in variables.values() if v.causality in ("parameter", "input")]
            raise UserError(f"{self.fmu}: no start value {name}; there are {', '.join([*settable, *self.states])}")
        kind = variables[name].type
        if not isinstance(value, str if kind == "String" else (float, Real, np.bool_)):
            raise UserError(f"{name}: {value!r} is not a value of type {kind}")
        return value

    def _initialized(self, start: Mapping[str, Any]) -> fmu_run.Instances:
        """The instance or a new one, in a state in which derivatives are available."""
        # A start value that was given before and is not given now would persist.
        if self._instance is None or not self._given <= start.keys():
            self._instance = self.loaded.instances(interface=self._interface, start=start)
        else:
            self._instance.reset(start=dict(start))
        self._given = set(start)
        return self._instance
