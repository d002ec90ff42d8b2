"""The linear model of an FMU, from its directional derivatives."""

from __future__ import annotations

import os
import shutil
import zipfile
from collections.abc import Mapping, Sequence
from ctypes import Array as CArray
from ctypes import c_double, c_uint32
from typing import Any
from xml.etree import ElementTree

import numpy as np

from prw.errors import UserError
from prw.extras import need
from prw.state_space import StateSpace
from prw.testbed import REAL, existing_fmu

INTERFACES = {"CoSimulation": "Co-Simulation", "ModelExchange": "Model Exchange"}
#: What directional derivatives exist of: Reals of FMI 2.0, floats of FMI 3.0.
CONTINUOUS = (*REAL, "Float32")
#: More rounds than any event iteration takes.
MOST_ROUNDS = 100


def linearize(
    fmu: str | os.PathLike[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    *,
    outputs: Sequence[str] | None = None,
    fmi_type: str | None = None,
) -> StateSpace:
    """The linear model of any FMU of FMI 2.0 or 3.0 that has directional derivatives, at its initial state.

    Parameters
    ----------
    fmu
        The FMU (default: the testbed's).
    parameters
        Start values of parameters, states and inputs by name, in the FMU's units; others keep their own. The
        testbed is linear, so of these only parameters matter there.
    outputs, fmi_type
        As for `Linearizer`, which is faster where this is asked for again and again.

    Raises
    ------
    UserError
        The FMU is missing, has no directional derivatives, lacks a name or refuses a value.
    """
    with Linearizer(fmu, outputs=outputs, fmi_type=fmi_type) as linearizer:
        return linearizer.at(parameters)


class Linearizer:
    """Linear models of one FMU, from one instance of it that stays: `at(parameters)` as often as needed. A context
    manager; leaving it unloads the FMU.

    outputs: names of y, outputs or states (default: the FMU's continuous outputs). fmi_type: "CoSimulation" or
    "ModelExchange" (default: the first of them that has directional derivatives). Raises UserError as `linearize`
    does.
    """

    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __init__(
        self,
        fmu: str | os.PathLike[str] | None = None,
        *,
        outputs: Sequence[str] | None = None,
        fmi_type: str | None = None,
    ):
        need("linearize", "fmpy")
        import fmpy

        self.fmu = existing_fmu(fmu)
        try:
            self._description = fmpy.read_model_description(str(self.fmu))
        except Exception as error:  # FMPy raises bare Exceptions
            raise UserError(f"{self.fmu}: cannot be read ({' '.join(str(error).split())})") from None
        self._fmi_type = self._interface(fmi_type)
        self._variables = {v.name: v for v in self._description.modelVariables}
        derivatives = {d.variable.derivative.name: d.variable.name for d in self._description.derivatives}
        known = [o.variable.name for o in self._description.outputs if o.variable.type in CONTINUOUS]
        self.states = tuple(derivatives)
        self.inputs = tuple(
            name for name, v in self._variables.items() if v.causality == "input" and v.type in CONTINUOUS
        )
        self.outputs = tuple(known if outputs is None else outputs)
        for name in self.outputs:
            if name not in known and name not in derivatives:
                choice = ", ".join(dict.fromkeys([*known, *self.states]))
                raise UserError(f"{self.fmu}: {name} is neither a continuous output nor a state; there are {choice}")
        for name in (*self.states, *self.inputs, *self.outputs):
            if self._variables[name].dimensions:
                raise UserError(f"{self.fmu}: {name} is an array; only scalar variables can be linearized")
        # A state is no unknown of FMI's directional derivatives, and its row of C needs none.
        self._calculated = [row for row, name in enumerate(self.outputs) if name not in derivatives]
        unknowns = [*derivatives.values(), *(self.outputs[row] for row in self._calculated)]
        self._unknowns = self._references(unknowns)
        self._knowns = [self._references([name]) for name in (*self.states, *self.inputs)]
        self._seed, self._column = (c_double * 1)(1.0), (c_double * len(unknowns))()
        self._units = {name: _unit(self._variables[name]) for name in (*self.states, *self.inputs, *self.outputs)}
        self._folder: str | None = fmpy.extract(str(self.fmu))
        self._instance: Any = None
        self._complaints: list[str] = []

    def at(self, parameters: Mapping[str, Any] | None = None) -> StateSpace:
        """The linear model with start values `parameters` (of parameters, states and inputs, by name, in the FMU's
        units); others keep the FMU's own. Raises UserError for a name or a value that the FMU does not take."""
        if self._folder is None:
            raise UserError(f"{self.fmu}: is closed")
        values = [(self._variable(name), value) for name, value in (parameters or {}).items()]
        self._complaints.clear()
        try:
            self._initialize(values)
            table = np.array([self._partials(known) for known in self._knowns], dtype=np.float64)
        except UserError:
            self._free()
            raise
        except Exception as error:  # FMPy raises bare Exceptions
            self._free()
            reason = self._complaints[-1] if self._complaints else error
            raise UserError(f"{self.fmu}: cannot be linearized ({reason})") from None
        table = table.reshape(len(self._knowns), len(self._unknowns)).T
        n = len(self.states)
        whole = np.zeros((len(self.outputs), len(self._knowns)))
        whole[self._calculated] = table[n:]
        for row, name in enumerate(self.outputs):
            if name in self.states:
                whole[row, self.states.index(name)] = 1.0
        A, B, C, D = (np.ascontiguousarray(m) for m in (table[:n, :n], table[:n, n:], whole[:, :n], whole[:, n:]))
        return StateSpace(A, B, C, D, self.states, self.inputs, self.outputs, self._units)

    def close(self) -> None:
        """Free the instance, unload the library and remove the unpacked files. Harmless when called again."""
        self._free()
        folder, self._folder = self._folder, None
        if folder is not None:
            shutil.rmtree(folder, ignore_errors=True)

    def __enter__(self) -> Linearizer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _interface(self, wanted: str | None) -> str:
        """The interface type to use."""
        version = self._description.fmiVersion
        if not version.startswith(("2.", "3.")):
            raise UserError(f"{self.fmu}: is of FMI {version}; FMI 2.0 and 3.0 have directional derivatives")
        # FMPy does not read this of FMI 3.0.
        attribute = "providesDirectionalDerivative" + ("" if version.startswith("2.") else "s")
        with zipfile.ZipFile(self.fmu) as archive:
            root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        offers = {name: element.get(attribute) for name in INTERFACES if (element := root.find(name)) is not None}
        able = [name for name, offer in offers.items() if offer in ("true", "1")]
        if wanted is None and able:
            return able[0]
        if wanted in able:
            return str(wanted)
        which = INTERFACES.get(wanted, wanted) if wanted else " or ".join(INTERFACES[name] for name in offers)
        other = f"; it does for {' and '.join(INTERFACES[name] for name in able)}" if able else ""
        raise UserError(f"{self.fmu}: offers no directional derivatives for {which} ({attribute} is not true){other}")

    def _references(self, names: Sequence[str]) -> CArray[c_uint32]:
        return (c_uint32 * len(names))(*(self._variables[name].valueReference for name in names))

    def _variable(self, name: str) -> Any:
        if name not in self._variables:
            settable = [v.name for v in self._variables.values() if v.causality in ("parameter", "input")]
            raise UserError(f"{self.fmu}: no start value {name}; there are {', '.join([*settable, *self.states])}")
        return self._variables[name]

    def _initialize(self, values: Sequence[tuple[Any, Any]]) -> None:
        """Bring the instance, or a new one, to where derivatives may be asked for."""
        if self._instance is None:
            self._instance = self._instantiated()
        else:
            self._instance.reset()
        fmu, fmi2 = self._instance, self._description.fmiVersion.startswith("2.")
        if fmi2:
            fmu.setupExperiment()
        for variable, value in values:
            _set(fmu, variable, value)
        fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        if self._fmi_type == "ModelExchange":
            update = fmu.newDiscreteStates if fmi2 else fmu.updateDiscreteStates
            for _ in range(MOST_ROUNDS):
                needed, *_ = update()
                if not needed:
                    break
            fmu.enterContinuousTimeMode()

    def _instantiated(self) -> Any:
        """A new instance, whose messages this hears."""
        from fmpy import calloc, fmi2, free
        from fmpy.simulation import instantiate_fmu

        if not self._description.fmiVersion.startswith("2."):
            return instantiate_fmu(
                self._folder, self._description, fmi_type=self._fmi_type, logger=self._hear, require_functions=False
            )
        # With a `logger`, FMPy sends the messages of all its instances of FMI 2.0 to that of the last one, also when it
        # is gone, and crashes. Without its help the arguments of printf are lost, no more.
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._hear)
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(free)
        interface, kind = (
            (self._description.coSimulation, fmi2.FMU2Slave)
            if self._fmi_type == "CoSimulation"
            else (self._description.modelExchange, fmi2.FMU2Model)
        )
        instance = kind(
            guid=self._description.guid,
            unzipDirectory=self._folder,
            modelIdentifier=interface.modelIdentifier,
            instanceName="linearized",
            requireFunctions=False,
        )
        instance.instantiate(callbacks=callbacks)
        return instance

    def _partials(self, known: CArray[c_uint32]) -> list[float]:
        """The derivatives of all unknowns by one known."""
        fmu, unknowns, column = self._instance, self._unknowns, self._column
        count = len(unknowns)
        if not count:
            return []
        if self._description.fmiVersion.startswith("2."):
            fmu.fmi2GetDirectionalDerivative(fmu.component, unknowns, count, known, 1, self._seed, column)
        else:
            fmu.fmi3GetDirectionalDerivative(fmu.component, unknowns, count, known, 1, self._seed, 1, column, count)
        return list(column)

    def _hear(self, *arguments: Any) -> None:
        # The message comes last, in both versions of FMI.
        message = arguments[-1] or b""
        self._complaints.append(message.decode("utf-8", "replace").strip())

    def _free(self) -> None:
        instance, self._instance = self._instance, None
        if instance is not None:
            instance.freeInstance()


def _set(fmu: Any, variable: Any, value: Any) -> None:
    """Give a variable its start value. Raises UserError where the value is none of its type."""
    kind = "Integer" if variable.type == "Enumeration" and hasattr(fmu, "setInteger") else variable.type
    kind = "Int64" if kind == "Enumeration" else kind
    try:
        if kind in CONTINUOUS:
            value = float(value)
        elif "Int" in kind:
            if int(value) != value:
                raise ValueError
            value = int(value)
        elif kind == "Boolean":
            value = bool(value)
        setter = getattr(fmu, f"set{kind}")
    except (TypeError, ValueError, AttributeError):
        raise UserError(f"{variable.name}: {value!r} is not a value of type {variable.type}") from None
    setter([variable.valueReference], [value])


def _unit(variable: Any) -> str:
    return variable.unit or getattr(variable.declaredType, "unit", None) or ""
