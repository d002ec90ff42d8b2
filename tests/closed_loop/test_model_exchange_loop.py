"""The closed loop with both FMUs in Model Exchange: the controller's samples are time events, an integrator takes the testbed
from one to the next. It must be what the Co-Simulation loop tends to as its steps become small."""

from __future__ import annotations

import ctypes
import shutil
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model
from fmpy.simulation import instantiate_fmu

from tools.validation import coupling
from tools.validation.system import System

SAMPLE, SAMPLES = 1e-3, 480
MEASURED = ("pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2")
MOTORS = ("theta1", "theta2", "omega1", "omega2")
WATCHED = ("testbed.pitch", "testbed.roll", "testbed.tau1", "controller.theta1")
STATES = 6


class Component:
    """An instance for Model Exchange, with Real variables by name."""

    def __init__(self, fmu: Path, name: str):
        description = fmpy.read_model_description(str(fmu))
        self.references = {variable.name: variable.valueReference for variable in description.modelVariables}
        self.folder = fmpy.extract(str(fmu))
        self.fmi: FMU2Model = instantiate_fmu(self.folder, description, fmi_type="ModelExchange")
        self.fmi.setupExperiment(startTime=0.0)

    def get(self, *names: str) -> list[float]:
        return self.fmi.getReal([self.references[name] for name in names])

    def set(self, names, values) -> None:
        self.fmi.setReal([self.references[name] for name in names], list(values))

    def close(self) -> None:
        self.fmi.terminate()
        self.fmi.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


class Loop:
    """Both FMUs, wired. The motors' motion depends on the time alone between samples, so there is no algebraic loop."""

    def __init__(self, testbed: Path, controller: Path, references: dict[str, float]):
        self.testbed, self.controller = Component(testbed, "testbed"), Component(controller, "controller")
        self.controller.set(references, references.values())
        for component in (self.testbed, self.controller):
            component.fmi.enterInitializationMode()
            component.fmi.exitInitializationMode()
        self.move(0.0)
        self.testbed.fmi.newDiscreteStates()
        self.testbed.fmi.enterContinuousTimeMode()
        self.sample()

    def move(self, time: float) -> None:
        """Sets the time, and the motors to where they are then."""
        for component in (self.testbed, self.controller):
            component.fmi.setTime(time)
        self.testbed.set(MOTORS, self.controller.get(*MOTORS))

    def sample(self) -> None:
        """The controller, in event mode, takes a sample of the testbed as it is. Remembers when it wants the next one."""
        self.controller.set(MEASURED, self.testbed.get(*MEASURED))
        _, _, _, _, due, self.next_sample = self.controller.fmi.newDiscreteStates()
        assert due
        self.controller.fmi.enterContinuousTimeMode()

    def row(self) -> list[float]:
        components = {"testbed": self.testbed, "controller": self.controller}
        return [components[component].get(name)[0] for component, name in (end.split(".") for end in WATCHED)]

    def run(self, advance: Callable[[Loop, float, float], None]) -> np.ndarray:
        """What is watched at every sample, (SAMPLES + 1, WATCHED). `advance(loop, from, to)` integrates between two."""
        rows, time = [self.row()], 0.0
        for k in range(1, SAMPLES + 1):
            assert self.next_sample == pytest.approx(k * SAMPLE, rel=1e-12)
            advance(self, time, self.next_sample)
            time = self.next_sample
            self.move(time)
            rows.append(self.row())
            self.controller.fmi.enterEventMode()
            self.sample()
        return np.array(rows)

    def close(self) -> None:
        self.testbed.close()
        self.controller.close()


def runge_kutta(steps: int):
    """The classical method with this many steps between two samples."""

    def advance(loop: Loop, start: float, end: float) -> None:
        fmi, h = loop.testbed.fmi, (end - start) / steps
        array = (ctypes.c_double * STATES)()

        def slope(time: float, x: np.ndarray) -> np.ndarray:
            loop.move(time)
            array[:] = x
            fmi.setContinuousStates(array, STATES)
            fmi.getDerivatives(array, STATES)
            return np.array(array)

        fmi.getContinuousStates(array, STATES)
        x = np.array(array)
        for time in start + h * np.arange(steps):
            k1 = slope(time, x)
            k2 = slope(time + h / 2, x + h / 2 * k1)
            k3 = slope(time + h / 2, x + h / 2 * k2)
            k4 = slope(time + h, x + h * k3)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        array[:] = x
        fmi.setContinuousStates(array, STATES)
        fmi.completedIntegratorStep()

    return advance


@pytest.fixture(scope="module")
def exact(fmu, controller_fmu, closed_loop: System) -> np.ndarray:
    """By Runge and Kutta with steps so small that halving them changes nothing to speak of."""
    references = {end.split(".")[1]: value for end, value in closed_loop.inputs.values()}
    found = []
    for steps in (8, 16):
        loop = Loop(fmu, controller_fmu, references)
        found.append(loop.run(runge_kutta(steps)))
        loop.close()
    assert np.abs(found[1] - found[0]).max() < 1e-9
    pitch, roll, torque, motor = np.abs(found[1]).max(axis=0)
    assert pitch > 0.5 and roll > 1.0 and torque > 0.5 and motor > 1.0, "it moves"
    return found[1]


def test_co_simulation_tends_to_it(exact, closed_loop: System):
    """Angles, of second order in the communication step, of which there are whole numbers in a sample."""

    def error(steps: int) -> np.ndarray:
        rows = coupling.couple(closed_loop, SAMPLE / steps, SAMPLE * SAMPLES, False, WATCHED)[::steps]
        return np.abs(rows - exact).max(axis=0)

    coarse, fine = error(8), error(16)
    angles = [WATCHED.index(name) for name in ("testbed.pitch", "testbed.roll", "controller.theta1")]
    assert np.all(fine[angles] < 1e-7), fine
    order = np.log2(coarse / fine)
    assert np.all((order[angles] > 1.9) & (order[angles] < 2.1)), (coarse, fine)
