"""An FMU that a Python program steps, with its variables by name."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Union

import fmpy
import numpy as np
from fmpy.simulation import instantiate_fmu

from prw.errors import UserError

Value = Union[float, int, bool]


class Slave:
    """An instance of a Co-Simulation FMU of FMI 2.0, initialized at time 0. A context manager: leaving it frees it.

        with Slave(Path("target/fmu/prw_testbed.fmu"), {"use_omega": True}) as testbed:
            testbed.set({"theta1": 0.1})
            testbed.step(1e-3)
            pitch, roll = testbed.get("pitch", "roll")

    Raises UserError where the FMU is missing or has no such variable; FMPy raises where the FMU refuses a call.
    """

    def __init__(self, path: Path, start: Mapping[str, Value] = {}):
        """Unpack and load the FMU file, with start values by name in the FMU's units."""
        if not path.is_file():
            raise UserError(f"{path}: no such FMU; `make closed-loop-fmus` builds it")
        description: Any = fmpy.read_model_description(str(path))
        self.path, self.time = path, 0.0
        self.variables = {variable.name: variable for variable in description.modelVariables}
        self._folder = fmpy.extract(str(path))
        self.fmu: Any = instantiate_fmu(self._folder, description, fmi_type="CoSimulation")
        try:
            self.fmu.setupExperiment(startTime=0.0)
            self.set(start)
            self.fmu.enterInitializationMode()
            self.fmu.exitInitializationMode()
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Slave:
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

    def get(self, *names: str) -> np.ndarray:
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
