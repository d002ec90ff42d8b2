"""The linear model of an FMU, from its directional derivatives; and the structure and units in its model description."""

from __future__ import annotations

import os
import zipfile
from collections.abc import Iterable, Mapping
from numbers import Real
from pathlib import Path
from typing import Any, Literal, NamedTuple, Self
from xml.etree import ElementTree

import fmu_run
import numpy as np

from prw.arguments import Given, names_of, values_of
from prw.errors import UserError
from prw.state_space import StateSpace
from prw.testbed import existing_fmu, loaded

#: Types of continuous variables in FMI 2.0 and 3.0.
CONTINUOUS = ("Real", "Float64", "Float32")


class Unit(NamedTuple):
    """exponents: by base unit, as strings. displayed: by display unit, the factor from the display unit to this unit."""

    exponents: Mapping[str, str]
    displayed: Mapping[str, float]


class Description(NamedTuple):
    """Parts of a model description. derivatives: the name of each state's derivative, by state. outputs: the continuous
    ones. directional: by interface type, whether it provides directional derivatives; attribute: the XML attribute that
    declares them. display_units: by variable. units: by name."""

    derivatives: dict[str, str]
    outputs: tuple[str, ...]
    directional: dict[str, bool]
    attribute: str
    display_units: dict[str, str]
    units: dict[str, Unit]


def read_description(fmu: Path) -> Description:
    """Read the model description of an FMU of FMI 2.0 or 3.0. The caller has loaded it with `fmu_run`, which checks it."""
    with zipfile.ZipFile(fmu) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    # An index in the list, from 1 (section 2.2.8 of FMI 2.0), or a value reference (section 2.4.8 of FMI 3.0).
    fmi2 = str(root.get("fmiVersion")).startswith("2.")
    reference, outputs, derivatives = (
        ("index", "Outputs/Unknown", "Derivatives/Unknown")
        if fmi2
        else ("valueReference", "Output", "ContinuousStateDerivative")
    )
    variables, typed = {}, {}
    for index, element in enumerate(root.iterfind("ModelVariables/*"), start=1):
        attributes = element[0] if fmi2 else element
        variables[str(index) if fmi2 else element.get("valueReference")] = element
        typed[element.get("name", "")] = attributes.tag, attributes
    types = {kind.get("name"): kind[0] if fmi2 else kind for kind in root.iterfind("TypeDefinitions/*")}

    def display_unit(variable: ElementTree.Element) -> str:
        declared = types.get(variable.get("declaredType"), variable)
        return variable.get("displayUnit") or declared.get("displayUnit") or ""

    def names(path: str) -> list[str]:
        return [
            variables[unknown.get(reference)].get("name", "") for unknown in root.iterfind(f"ModelStructure/{path}")
        ]

    attribute = "providesDirectionalDerivative" + ("" if fmi2 else "s")
    offers = {name: found for name in INTERFACES if (found := root.find(name)) is not None}
    return Description(
        {str(variables[typed[name][1].get("derivative")].get("name")): name for name in names(derivatives)},
        tuple(name for name in names(outputs) if typed[name][0] in CONTINUOUS),
        {name: found.get(attribute) in ("true", "1") for name, found in offers.items()},
        attribute,
        {name: display_unit(element) for name, (_, element) in typed.items()},
        {str(unit.get("name")): _unit(unit) for unit in root.iterfind("UnitDefinitions/Unit")},
    )


def _unit(element: ElementTree.Element) -> Unit:
    base = element.find("BaseUnit")
    exponents = {} if base is None else {n: v for n, v in base.items() if n not in ("factor", "offset")}
    # factor: from this unit to the displayed one (section 2.2.2 of FMI 2.0, 2.4.3 of FMI 3.0).
    displayed = {str(d.get("name")): 1 / float(d.get("factor", "1")) for d in element.iterfind("DisplayUnit")}
    return Unit(exponents, displayed)


#: Start values of the testbed with which its states and inputs are independent of each other in Co-Simulation. With
#: others a motor angle also changes the rate that is estimated from it and, before the first step, the states.
INDEPENDENT = {"use_omega": True, "start_at_rest": False}
Interface = Literal["co-simulation", "model-exchange"]
INTERFACES = {"CoSimulation": "Co-Simulation", "ModelExchange": "Model Exchange"}


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
        Start values of parameters, states and inputs by name, in the FMU's units or with a unit as (1.9, "N.m/deg"), or the
        JSON file with them that `prw.identify` writes; other variables keep their start values. The
        testbed is linear, so only parameters matter there. `use_omega` is set to true and `start_at_rest` to
        false if they are not given: A, B, C and D are then the matrices of eq. (11), with the motors' angles and rates as
        independent inputs. With `use_omega` false, Co-Simulation estimates the rates from the angles and ignores
        `omega1` and `omega2`.
    fmu
        The FMU (default: the testbed's).
    outputs, fmi_type
        As for `Linearizer`, which is faster for many models of one FMU.

    Raises
    ------
    UserError
        The FMU is missing, has no directional derivatives, lacks a name or rejects a value.
    """
    with Linearizer(fmu, outputs=outputs, fmi_type=fmi_type) as linearizer:
        return linearizer.at(parameters)


class Linearizer:
    """Linear models of one FMU, from one instance: call `at(parameters)` as often as needed. A context
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
            self._look(outputs, fmi_type)
        except UserError:
            self.loaded.close()
            raise

    def _look(self, outputs: str | Iterable[str] | None, fmi_type: str | None) -> None:
        """Find states, inputs and outputs. Raises UserError."""
        description, variables = read_description(self.fmu), self.loaded.variables
        chosen = self._chosen(fmi_type, description.directional, description.attribute)
        self._interface: Interface = "co-simulation" if chosen == "CoSimulation" else "model-exchange"
        self.states = tuple(description.derivatives)
        self.inputs = tuple(v.name for v in variables.values() if v.causality == "input" and v.type in CONTINUOUS)
        self.outputs = description.outputs if outputs is None else names_of("outputs", outputs)
        for name in self.outputs:
            if name not in description.outputs and name not in self.states:
                choice = ", ".join(dict.fromkeys([*description.outputs, *self.states]))
                raise UserError(f"{self.fmu}: {name} is neither a continuous output nor a state; there are {choice}")
        # A state is no unknown of FMI's directional derivatives, and its row of C needs none.
        self._calculated = [row for row, name in enumerate(self.outputs) if name not in self.states]
        self._unknowns = (*description.derivatives.values(), *(self.outputs[row] for row in self._calculated))
        self._knowns = (*self.states, *self.inputs)
        for name in (*self._knowns, *self._unknowns):
            if name not in variables:
                raise UserError(f"{self.fmu}: {name} is an array; only scalar variables can be linearized")
        self._units = {name: variables[name].unit or "" for name in (*self._knowns, *self.outputs)}
        self._instance: fmu_run.Instances | None = None
        self._given: set[str] = set()
        self._closed = False

    def at(self, parameters: Given = None) -> StateSpace:
        """The linear model with start values `parameters` (of parameters, states and inputs, by name, in the FMU's
        units, or a file with them); others keep the FMU's own. Raises UserError for a name or a value that the FMU does not take."""
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
            raise UserError(f"{self.fmu}: cannot be linearized ({error})") from None
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

    def _chosen(self, wanted: str | None, directional: Mapping[str, bool], attribute: str) -> str:
        """The interface type to use."""
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
        """The value, if it is one of the variable's type. Raises UserError."""
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
