"""The testbed FMU, driven through FMPy as a Co-Simulation slave."""

from __future__ import annotations

import shutil
import sys
from ctypes import c_double, c_uint32
from pathlib import Path
from typing import Dict, Mapping, Sequence

import fmpy
import numpy as np
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import fmi2Error
from fmpy.simulation import instantiate_fmu

from prw.errors import UserError
from prw.motion import Motion
from prw.progress import Progress

OUTPUTS = ("tau1", "tau2", "pitch", "roll", "pitch_rate", "roll_rate", "theta3", "theta4")
REPORT_STEPS = 4096


class Testbed:
    """One instance of the testbed FMU. A context manager: leaving it frees the instance, the library and the files.

    Raises UserError where the FMU is missing, is not the testbed, or refuses a call (with what it logged).
    """

    def __init__(self, fmu: Path):
        """Unpack, load and instantiate the FMU file `fmu`."""
        self._slave, self._folder, self._refusals = None, None, []
        if not fmu.is_file():
            raise UserError(f"{fmu}: no such FMU; `make fmu` builds it")
        try:
            self._description = fmpy.read_model_description(str(fmu))
            self._references = {v.name: v.valueReference for v in self._description.modelVariables}
            missing = [name for name in ("theta1", "theta2", "use_omega", *OUTPUTS) if name not in self._references]
            if missing or self._description.coSimulation is None:
                raise UserError(
                    f"{fmu}: not the testbed FMU for Co-Simulation (it lacks {', '.join(missing) or 'that interface'})"
                )
            self._folder = fmpy.extract(str(fmu))
            self._slave = instantiate_fmu(self._folder, self._description, fmi_type="CoSimulation", logger=self._hear)
        except UserError:
            raise
        except Exception as error:
            # FMPy raises bare Exceptions for an unreadable archive, a missing binary or a failed instantiation.
            self.close()
            raise UserError(f"{fmu}: cannot be loaded ({self._why(error)})") from None

    def __enter__(self) -> Testbed:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the instance, unload the library and remove the unpacked files. Harmless when called again."""
        slave, self._slave = self._slave, None
        if slave is not None:
            slave.freeInstance()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    def respond(self, motion: Motion, outputs: Sequence[str] = OUTPUTS) -> Dict[str, np.ndarray]:
        """Response to `motion` from rest at its first angles; each sample is one communication point.

        Returns `outputs` (any Real variables) by name, each (n,), in the FMU's units (N.m, rad, rad/s). Sample k is read
        at time[k] with the motors' angles (and rates, where the motion has them) of sample k set, so a row belongs
        together.
        """
        rates = motion.omega is not None
        names = ("theta1", "theta2", "omega1", "omega2") if rates else ("theta1", "theta2")
        inputs = np.ascontiguousarray(np.hstack([motion.theta, motion.omega]) if rates else motion.theta)
        table = np.empty((len(motion.time), len(outputs)))
        try:
            self._initialize(motion, rates)
            self._step_through(motion, names, inputs, outputs, table)
            self._slave.terminate()
        except FMICallException as error:
            raise UserError(f"the FMU stopped: {self._why(error)}") from None
        return dict(zip(outputs, np.ascontiguousarray(table.T)))

    def _initialize(self, motion: Motion, rates: bool) -> None:
        slave, (theta1, theta2) = self._slave, motion.theta[0]
        slave.setupExperiment(startTime=motion.time[0], stopTime=motion.time[-1])
        self._set({"theta3": theta1, "theta5": theta1, "theta4": theta2, "theta6": theta2})
        slave.setBoolean([self._references["use_omega"]], [rates])
        slave.enterInitializationMode()
        self._set({"theta1": theta1, "theta2": theta2})
        if rates:
            self._set(dict(zip(("omega1", "omega2"), motion.omega[0])))
        slave.exitInitializationMode()

    def _step_through(self, motion: Motion, names, inputs: np.ndarray, outputs, table: np.ndarray) -> None:
        # A recording may have a million rows: bare FMI calls, reading and writing the rows of the arrays in place.
        slave, component = self._slave, self._slave.component
        n_in, n_out, time = len(names), len(outputs), motion.time.tolist()
        in_references = (c_uint32 * n_in)(*(self._references[name] for name in names))
        out_references = (c_uint32 * n_out)(*(self._references[name] for name in outputs))
        in_row, out_row = c_double * n_in, c_double * n_out
        last = len(time) - 1
        with Progress(f"simulating {motion.name}", last) as progress:
            for k, t in enumerate(time):
                in_place, out_place = k * inputs.strides[0], k * table.strides[0]
                try:
                    slave.fmi2SetReal(component, in_references, n_in, in_row.from_buffer(inputs, in_place))
                    slave.fmi2GetReal(component, out_references, n_out, out_row.from_buffer(table, out_place))
                    if k < last:
                        slave.fmi2DoStep(component, t, time[k + 1] - t, True)
                except FMICallException as error:
                    raise UserError(f"the FMU stopped at time {t!r}: {self._why(error)}") from None
                if k % REPORT_STEPS == 0:
                    progress(k)

    def _set(self, values: Mapping[str, float]) -> None:
        self._slave.setReal([self._references[name] for name in values], list(values.values()))

    def _hear(self, _environment, _instance, status: int, _category, message) -> None:
        text = (message or b"").decode("utf-8", "replace").strip()
        if status >= fmi2Error:
            self._refusals.append(text)  # part of the UserError that follows
        else:
            print(f"FMU: {text}", file=sys.stderr)

    def _why(self, error: Exception) -> str:
        return self._refusals[-1] if self._refusals else str(error)
