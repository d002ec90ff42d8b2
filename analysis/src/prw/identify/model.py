"""The testbed FMU as a function of its parameters: one instance, reset and run again, or asked for its linear
model."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.simulation import instantiate_fmu

from prw.errors import UserError
from prw.motion import Motion
from prw.testbed import OUTPUTS, Testbed, driven_by, stopped

STATES = ("theta3", "theta4", "theta5", "theta6", "omega5", "omega6")
INPUTS = ("theta1", "theta2", "omega1", "omega2")


class Parameter(NamedTuple):
    """A parameter as the FMU declares it. start: its start value in SI. shown, factor: the unit it is shown in, and
    what a value in that unit is multiplied with to be in SI. meaning: its description."""

    name: str
    start: float
    unit: str
    shown: str
    factor: float
    meaning: str


class Matrices(NamedTuple):
    """x' = A x + B u, y = C x + D u of eq. (11), with the FMU's states and inputs in the order of STATES and INPUTS
    and its outputs in the order of OUTPUTS: A (6, 6), B (6, 4), C (8, 6), D (8, 4). Or m of them stacked: A (m, 6, 6)
    ..."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray


class Model(Testbed):
    """The testbed FMU as a function of its parameters.

    A context manager like Testbed; raises UserError as it does.
    """

    _slave = None

    def __init__(self, fmu: Path):
        """Unpack, load and instantiate the FMU file `fmu`."""
        super().__init__(fmu)
        self.fmu = fmu
        self.parameters: Dict[str, Parameter] = {}
        self.counts: Dict[str, int] = {}
        self._said: List[str] = []
        self._description = fmpy.read_model_description(str(fmu))
        self._references = {v.name: v.valueReference for v in self._description.modelVariables}
        shown = {
            (unit.name, display.name): 1 / display.factor
            for unit in self._description.unitDefinitions
            for display in unit.displayUnits
        }
        for v in self._description.modelVariables:
            if v.causality != "parameter":
                continue
            if v.type == "Real":
                unit, display = v.unit, v.displayUnit or v.unit
                factor = shown.get((unit, display), 1.0)
                self.parameters[v.name] = Parameter(v.name, float(v.start), unit, display, factor, v.description or "")
            elif v.type == "Integer":
                self.counts[v.name] = int(v.start)
        if self._description.coSimulation.providesDirectionalDerivative is not True:
            self.close()
            raise UserError(f"{fmu}: offers no directional derivatives of FMI 2.0 for Co-Simulation")

    @property
    def guid(self) -> str:
        """The guid of the FMU: a hash of its sources and start values."""
        return self._description.guid

    @property
    def units(self) -> list:
        """The FMU's unit definitions, as FMPy has them."""
        return self._description.unitDefinitions

    def meaning(self, name: str) -> str:
        """The description of the variable `name`."""
        return next(v.description or "" for v in self._description.modelVariables if v.name == name)

    def run(
        self, motion: Motion, values: Mapping[str, float], outputs: Sequence[str] = OUTPUTS, state=None
    ) -> Dict[str, np.ndarray]:
        """Give the FMU the parameters `values` (SI, by name; others keep their start values) and let it follow
        `motion`, as Testbed.respond does. state: (6,) initial x; default: at rest at the motors' first
        angles."""
        start = dict(values)
        if state is not None:
            start.update(zip(STATES, map(float, state)))
        return self.respond(motion, outputs, start)

    def close(self) -> None:
        """Free the instance, unload the library and remove the unpacked files. Harmless when called again."""
        slave, self._slave = self._slave, None
        if slave is not None:
            slave.freeInstance()
            shutil.rmtree(self._folder, ignore_errors=True)
        super().close()

    def follow(
        self,
        motion: Motion,
        channels: Sequence[str],
        values: Sequence[Mapping[str, float]],
        every: int = 1,
        state: Optional[np.ndarray] = None,
    ) -> np.ndarray:
        """What the FMU answers to `motion` with m sets of parameters (SI, by name; each with the same names): the channels
        (m, k, len(channels)) at every `every`-th of the times. state: (6,) initial x; default: at rest at the motors'
        first angles."""
        start: Dict[str, np.ndarray] = {name: np.array([each[name] for each in values]) for name in values[0]}
        start.update(zip(STATES, np.asarray(() if state is None else state, dtype=float)))
        return self._courses(motion, channels, every, start)

    def transients(self, time: np.ndarray, channels: Sequence[str], values: Mapping[str, float]) -> np.ndarray:
        """What each initial state adds to the channels at `time` (k,): (k, len(channels), 6). That is linear, so the motors
        rest at 0, and between two times the FMU is exact."""
        still = np.zeros((len(time), 2))
        table = self._courses(
            Motion(time, still, still), channels, 1, {**values, **dict(zip(STATES, np.eye(len(STATES))))}
        )
        return np.moveaxis(table, 0, -1)

    def _courses(self, motion: Motion, channels: Sequence[str], every: int, start: Mapping) -> np.ndarray:
        """(runs, times, channels)"""
        runs = self.loaded.run(motion.time, outputs=channels, every=every, **driven_by(motion, start))
        for why in runs.errors.values():
            raise UserError(f"{self.fmu}: {stopped(why)}")
        return np.stack([runs[name] for name in channels], axis=2)

    def matrices(self, values: Mapping[str, float]) -> Matrices:
        """The FMU's linear model with the parameters `values` (SI, by name), from fmi2GetDirectionalDerivative."""
        if self._slave is None:
            self._folder = fmpy.extract(str(self.fmu))
            self._slave = instantiate_fmu(self._folder, self._description, fmi_type="CoSimulation", logger=self._hear)
        reference, slave = self._references, self._slave
        rates = [reference[f"der({name})"] for name in STATES]
        calculated = [name for name in OUTPUTS if name not in STATES]
        unknowns = rates + [reference[name] for name in calculated]
        try:
            slave.reset()
            slave.setupExperiment()
            slave.setReal([reference[name] for name in values], list(values.values()))
            slave.enterInitializationMode()
            slave.exitInitializationMode()
            columns = [slave.getDirectionalDerivative(unknowns, [reference[name]], [1.0]) for name in STATES + INPUTS]
        except FMICallException as error:
            raise UserError(f"{self.fmu}: {self._said[-1] if self._said else error}") from None
        table = np.array(columns).T
        # A state is no unknown of FMI's directional derivatives, and its row of C needs none.
        whole = np.zeros((len(OUTPUTS), table.shape[1]))
        for row, name in enumerate(OUTPUTS):
            if name in calculated:
                whole[row] = table[len(STATES) + calculated.index(name)]
            else:
                whole[row, STATES.index(name)] = 1.0
        n = len(STATES)
        return Matrices(table[:n, :n], table[:n, n:], whole[:, :n], whole[:, n:])

    def _hear(self, _environment, _instance, _status, _category, message) -> None:
        self._said.append((message or b"").decode("utf-8", "replace").strip())


def stack(matrices: Sequence[Matrices]) -> Matrices:
    """Several linear models as one with a leading axis."""
    return Matrices(*(np.stack(blocks) for blocks in zip(*matrices)))
