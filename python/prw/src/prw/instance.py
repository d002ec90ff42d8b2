"""An FMU that a Python program steps, with its variables by name."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from typing import Any

import numpy as np

from prw.errors import UserError
from prw.extras import need
from prw.motion import Array
from prw.testbed import Value, existing_fmu


class Instance:
    """An instance of a Co-Simulation FMU of FMI 2.0, initialized at time 0. A context manager: leaving it frees it.

        with Instance(start={"use_omega": True}) as testbed:
            testbed.set({"theta1": 0.1})
            testbed.step(1e-3)
            pitch, roll = testbed.get("pitch", "roll")

    Raises UserError where the FMU or FMPy is missing or there is no such variable; FMPy raises where the FMU refuses a call.
    """

    def __init__(self, fmu: str | os.PathLike[str] | None = None, start: Mapping[str, Value] = {}):
        """Unpack and load the FMU file (default: the testbed's), with start values by name in the FMU's units."""
        need("linearize", "fmpy")
        import fmpy
        from fmpy.simulation import instantiate_fmu

        self.path, self.time = existing_fmu(fmu), 0.0
        description: Any = fmpy.read_model_description(str(self.path))
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self._folder = fmpy.extract(str(self.path))
        self.fmu: Any = instantiate_fmu(self._folder, description, fmi_type="CoSimulation")
        try:
            self.fmu.setupExperiment(startTime=0.0)
            self.set(start)
            self.fmu.enterInitializationMode()
            self.fmu.exitInitializationMode()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Instance:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def reference(self, name: str) -> int:
        """The value reference of a variable."""
        if name not in self.variables:
            raise UserError(f"{self.path}: there is no variable {name}")
        return int(self.variables[name].valueReference)

    def set(self, values: Mapping[str, Value]) -> None:
        """Set variables."""
        setters = {"Real": self.fmu.setReal, "Integer": self.fmu.setInteger, "Boolean": self.fmu.setBoolean}
        for name, value in values.items():
            reference = self.reference(name)
            setters[self.variables[name].type]([reference], [value])

    def get(self, *names: str) -> Array:
        """The values of Real variables, in the order of the names."""
        return np.array(self.fmu.getReal([self.reference(name) for name in names]))

    def step(self, size: float) -> None:
        """Go on by `size` s."""
        self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
        self.time += size

    def close(self) -> None:
        """Free the instance and remove the unpacked files."""
        self.fmu.freeInstance()
        shutil.rmtree(self._folder, ignore_errors=True)
