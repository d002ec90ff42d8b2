"""An instance of the testbed FMU with variables by name, through FMPy's FMI 2.0 calls."""

from __future__ import annotations

import numpy as np
from fmpy import calloc, free
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from lagrange import OUTPUTS


class Instance:
    """A Co-Simulation instance. `messages` holds its log messages as (status, category, text)."""

    def __init__(self, unpacked, description, name: str = "testbed"):
        self.variables = {v.name: v for v in description.modelVariables}
        self.messages = []
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(self._log)
        callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        self.fmi = FMU2Slave(
            guid=description.guid,
            modelIdentifier=description.coSimulation.modelIdentifier,
            unzipDirectory=unpacked,
            instanceName=name,
        )
        self.fmi.instantiate(callbacks=callbacks, loggingOn=True)
        self._references = {}

    def free(self) -> None:
        """Frees the instance and unloads the library."""
        self.fmi.freeInstance()

    def unexpected_messages(self) -> list:
        """Returns the messages that are warnings or errors, or whose category is not logEvents."""
        return [message for message in self.messages if message[0] > 0 or message[1] != "logEvents"]

    def set(self, **values) -> None:
        """Sets variables by name, each with the setter of its type."""
        for name, value in values.items():
            variable = self.variables[name]
            setter = {"Real": self.fmi.setReal, "Integer": self.fmi.setInteger, "Boolean": self.fmi.setBoolean}
            setter[variable.type]([variable.valueReference], [value])

    def get(self, *names) -> np.ndarray:
        """Returns the values of the named Real variables."""
        return np.array(self.fmi.getReal([self.variables[name].valueReference for name in names]))

    def start(self, theta=(0.0, 0.0), rate=None, time=0.0, **parameters) -> None:
        """Initializes at the motor angles theta (2,) rad, by default at rest. use_omega is true if and only if `rate` (2,) rad/s is given.

        `parameters` are set by name before initialization.
        """
        self.fmi.setupExperiment(startTime=time)
        self.set(use_omega=rate is not None, **parameters)
        self.fmi.enterInitializationMode()
        self.set(theta1=theta[0], theta2=theta[1])
        if rate is not None:
            self.set(omega1=rate[0], omega2=rate[1])
        self.fmi.exitInitializationMode()

    def step(self, t: float, h: float) -> None:
        """Calls fmi2DoStep from the time t with the step size h."""
        self.fmi.doStep(currentCommunicationPoint=t, communicationStepSize=h)

    def run(self, t, theta, rate=None, derivative=None):
        """Steps through the times t (n,) after a call of `start`, and sets the motor angles theta (n, 2) at each time.

        If given, rate (n, 2) sets omega1 and omega2, and derivative (n, 2) the input derivatives of the angles. Returns (at, after)
        like `follow` of the oracle."""
        angles = [self.variables[name].valueReference for name in ("theta1", "theta2")]
        rates = [self.variables[name].valueReference for name in ("omega1", "omega2")]
        t = [float(s) for s in t]
        at, after = [], []
        for k, s in enumerate(t):
            self.fmi.setReal(angles, theta[k])
            if rate is not None:
                self.fmi.setReal(rates, rate[k])
            if derivative is not None:
                self.fmi.setRealInputDerivatives(angles, [1, 1], derivative[k])
            at.append(self.get(*OUTPUTS))
            if k < len(t) - 1:
                self.step(s, t[k + 1] - s)
                after.append(self.get(*OUTPUTS))
        return dict(zip(OUTPUTS, np.array(at).T)), dict(zip(OUTPUTS, np.array(after).T))

    def _log(self, _environment, _instance, status, category, message) -> None:
        self.messages.append((status, (category or b"").decode(), (message or b"").decode()))


def assert_close(found, expected, tolerance: float) -> None:
    """Checks that the error of every output is within `tolerance`, relative to the largest absolute value of the expected output."""
    for name in OUTPUTS:
        scale = max(np.max(np.abs(expected[name])), 1e-300)
        error = np.max(np.abs(found[name] - expected[name])) / scale
        assert error <= tolerance, f"{name}: off by {error:.2e} of its largest value {scale:.3g}"
