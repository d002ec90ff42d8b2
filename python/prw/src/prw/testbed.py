"""The testbed FMU, and its runs in Co-Simulation."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from numbers import Real
from pathlib import Path
from typing import Any, Self

import fmu_run
import numpy as np

from prw.arguments import check_names
from prw.columns import ANGLES, CHANNELS, RATES
from prw.errors import UserError, of_fmu
from prw.files import CLONE, PACKAGE
from prw.motion import Array, Motion

#: The angle of each rate, see `StateSpace.transfer`.
ANGLE_OF = dict(zip(RATES, ANGLES))

Value = float | int | bool
#: Types of continuous variables in `fmu_run`.
CONTINUOUS = ("Real", "Float32")
#: The environment variable that names an FMU, the FMU in the wheel, and the FMU that `make fmu` writes in the clone.
VARIABLE = "PRW_FMU"
INSIDE = PACKAGE / "fmu" / "prw_testbed.fmu"
BUILT = CLONE / "target" / "fmu" / "prw_testbed.fmu"


def default_fmu() -> Path:
    """The path of the default testbed FMU, for any importer, as in `fmu_run.Fmu(prw.default_fmu())`.

    The environment variable PRW_FMU has precedence, then the FMU in the installed package, then the FMU that `make fmu`
    builds in the clone from which the package is installed. Raises UserError if there is none.
    """
    if named := os.environ.get(VARIABLE):
        if not Path(named).is_file():
            raise UserError(f"{named}: no such FMU, which the environment variable {VARIABLE} names")
        return Path(named)
    for path in (INSIDE, BUILT):
        if path.is_file():
            return path
    raise UserError(
        f"there is no FMU: none is named by fmu= (--fmu in the shell), {VARIABLE} is not set, there is no {INSIDE}, and no {BUILT}, "
        "which `make fmu` builds in a clone"
    )


def existing_fmu(fmu: str | os.PathLike[str] | None) -> Path:
    """The FMU file `fmu`, or the default one. Raises UserError if there is none."""
    path = default_fmu() if fmu is None else Path(fmu)
    if not path.is_file():
        raise UserError(f"{path}: no such FMU")
    return path


def loaded(fmu: Path) -> fmu_run.Fmu:
    """Loads the FMU file. Raises UserError if it cannot be loaded."""
    try:
        return fmu_run.Fmu(fmu)
    except fmu_run.FmuError as error:
        raise UserError(f"{fmu}: cannot be loaded ({str(error).removeprefix(f'{fmu}: ')})") from None


class Testbed:
    """The testbed FMU, loaded once for any number of runs. A context manager: leaving it unloads the library and
    removes the unpacked files.

    Raises UserError if the FMU is missing, is not the testbed, or rejects a call (with its log message).
    """

    # Otherwise pytest would take this class for tests because of its name.
    __test__ = False

    def __init__(self, fmu: Path | None = None):
        """Unpack and load the FMU file `fmu` (default: see `default_fmu`)."""
        self.fmu = fmu = existing_fmu(fmu)
        self.loaded = loaded(fmu)
        missing = [name for name in (*ANGLES, "use_omega", *CHANNELS) if name not in self.loaded.variables]
        if missing:
            self.close()
            raise UserError(f"{fmu}: not the testbed FMU for Co-Simulation (it lacks {', '.join(missing)})")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Unload the library and remove the unpacked files. Harmless when called again."""
        self.loaded.close()

    @property
    def starts(self) -> dict[str, float]:
        """The start values of the Real parameters in SI, by name."""
        parameters = (v for v in self.loaded.variables.values() if v.causality == "parameter" and v.type in CONTINUOUS)
        return {v.name: float(_start_of(v)) for v in parameters}

    def with_starts(self, parameters: Mapping[str, Value]) -> dict[str, Value]:
        """The value of every parameter except strings and `use_omega`, in the FMU's units: `parameters`, and the start values
        of the others.
        Raises UserError for a name that is not a parameter, or a value that is not a number."""
        known = {
            v.name: _start_of(v)
            for v in self.loaded.variables.values()
            if v.causality == "parameter" and v.type != "String" and v.name != "use_omega"
        }
        check_names("parameters", parameters, known)
        for name, value in parameters.items():
            if not isinstance(value, (Real, np.bool_)):
                raise UserError(
                    f"{name} is {value!r}, not a number; prw.sweep takes many values", argument="parameters"
                )
        return {**known, **parameters}

    def respond(
        self, motion: Motion, outputs: Sequence[str] | None = None, start: Mapping[str, float] = {}
    ) -> dict[str, Array]:
        """Response to `motion` with the start values `start` (parameters by name, in the FMU's units), by default from rest at
        the first angles; each sample is one communication point.

        Returns `outputs` (any Real variables; by default all outputs) by name, each (n,), in the FMU's units (N.m, rad, rad/s). Sample k is
        read at time[k], after the motors' angles (and rates, if the motion has them) of sample k were set, so all
        values of a row belong to the same instant. Raises UserError if the FMU rejects a value or the run fails.
        """
        try:
            names = self.loaded.outputs if outputs is None else outputs
            runs = self.loaded.run(motion.time, outputs=names, **driven_by(motion, start))
        except ValueError as error:
            raise UserError(str(error)) from None
        if runs.errors:
            raise UserError(stopped(runs.errors[0]))
        return {name: trajectory[0] for name, trajectory in runs.items()}


def stopped(why: str) -> str:
    """The message about a run that failed. why: from fmu_run."""
    why = of_fmu(why)
    return f"the FMU stopped {why}" if why.startswith("at ") else f"the FMU stopped: {why}"


def driven_by(motion: Motion, start: Mapping[str, Any] = {}) -> dict[str, Any]:
    """Arguments of `fmu_run.Fmu.run` for motors that follow `motion`, with the start values `start`, by default from rest at the
    first angles."""
    inputs = dict(zip(ANGLES, motion.theta.T))
    if motion.omega is not None:
        inputs.update(zip(RATES, motion.omega.T))
    return {"inputs": inputs, "start": {"use_omega": motion.omega is not None, **start}}


def _start_of(variable: fmu_run.Variable) -> Value:
    """The start value of a parameter that is not a String. Raises UserError if there is none that has this type."""
    kind, start = variable.type, variable.start
    booleans = {"true": True, "1": True, "false": False, "0": False}
    try:
        return booleans[str(start)] if kind == "Boolean" else float(start) if kind in CONTINUOUS else int(start)  # type: ignore[arg-type]
    except (KeyError, TypeError, ValueError):
        raise UserError(f"the parameter {variable.name} of the FMU has the start value {start!r}") from None
