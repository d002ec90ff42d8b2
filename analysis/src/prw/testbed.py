"""The testbed FMU as a Co-Simulation slave."""

from __future__ import annotations

from pathlib import Path
from typing import Dict, Mapping, Sequence

import fmu_run
import numpy as np

from prw.errors import UserError
from prw.motion import Motion

OUTPUTS = ("tau1", "tau2", "pitch", "roll", "pitch_rate", "roll_rate", "theta3", "theta4")
ANGLES, RATES = ("theta1", "theta2"), ("omega1", "omega2")


class Testbed:
    """The testbed FMU, loaded once for any number of runs. A context manager: leaving it unloads the library and removes the
    unpacked files.

    Raises UserError where the FMU is missing, is not the testbed, or refuses a call (with what it logged).
    """

    def __init__(self, fmu: Path):
        """Unpack and load the FMU file `fmu`."""
        if not fmu.is_file():
            raise UserError(f"{fmu}: no such FMU; `make fmu` builds it")
        try:
            self.loaded = fmu_run.Fmu(fmu)
        except fmu_run.FmuError as error:
            raise UserError(f"{fmu}: cannot be loaded ({str(error).removeprefix(f'{fmu}: ')})") from None
        missing = [name for name in (*ANGLES, "use_omega", *OUTPUTS) if name not in self.loaded.variables]
        if missing:
            self.close()
            raise UserError(f"{fmu}: not the testbed FMU for Co-Simulation (it lacks {', '.join(missing)})")

    def __enter__(self) -> Testbed:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Unload the library and remove the unpacked files. Harmless when called again."""
        self.loaded.close()

    @property
    def starts(self) -> Dict[str, float]:
        """The start values of the Real parameters in SI, by name."""
        parameters = (v for v in self.loaded.variables.values() if v.causality == "parameter" and v.type == "Real")
        return {v.name: float(v.start) for v in parameters}

    def respond(
        self, motion: Motion, outputs: Sequence[str] = OUTPUTS, start: Mapping[str, float] = {}
    ) -> Dict[str, np.ndarray]:
        """Response to `motion` from rest at its first angles, or from the start values `start` (parameters by name, in
        the FMU's units); each sample is one communication point.

        Returns `outputs` (any Real variables) by name, each (n,), in the FMU's units (N.m, rad, rad/s). Sample k is read
        at time[k] with the motors' angles (and rates, where the motion has them) of sample k set, so a row belongs
        together.
        """
        runs = self.loaded.run(motion.time, outputs=outputs, **driven_by(motion, start))
        if runs.errors:
            raise UserError(stopped(runs.errors[0]))
        return {name: course[0] for name, course in runs.items()}


def stopped(why: str) -> str:
    """What is told of a run that the FMU has refused."""
    return f"the FMU stopped {why}" if why.startswith("at ") else f"the FMU stopped: {why}"


def driven_by(motion: Motion, start: Mapping[str, float] = {}) -> dict:
    """What `fmu_run.Fmu.run` is given for motors that follow `motion` from rest at its first angles, or from `start`."""
    rates = motion.omega is not None
    inputs = dict(zip(ANGLES, motion.theta.T))
    if rates:
        inputs.update(zip(RATES, motion.omega.T))
    return {"inputs": inputs, "start": {"use_omega": rates, **start}}
