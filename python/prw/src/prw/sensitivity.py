"""Derivatives of a simulation with respect to the parameters: `sensitivities`."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import fmu_run

from prw.arguments import Given, Table, check_names, names_of, values_of
from prw.errors import UserError
from prw.motion import Motion
from prw.recording import Recording
from prw.simulation import Run, motion_of
from prw.testbed import Testbed, driven_by


def sensitivities(
    motion: Motion | Recording | Run | str | os.PathLike[str] | Table | None = None,
    parameters: str | Iterable[str] | None = None,
    *,
    values: Given = None,
    outputs: str | Sequence[str] | None = None,
    steps: Mapping[str, float] = {},
    fmu: str | os.PathLike[str] | None = None,
) -> fmu_run.Sensitivities:
    """Differentiate the response of the testbed with respect to its parameters.

    The derivatives are central differences of runs in one batch. Each has an estimated error, because the step is chosen by the noise of
    the FMU; see `fmu_run.Fmu.sensitivities`, which does this for any FMU.

    Parameters
    ----------
    motion
        The motion of the motors, as for `prw.simulate`.
    parameters
        Names of parameters. Default: all Real parameters that are not 0.
    values
        Values of parameters at which to differentiate, as `parameters` for `prw.simulate`.
    outputs
        Names of any Real variables. Default: all outputs.
    steps
        The largest step of a parameter by name, as for `fmu_run.Fmu.sensitivities`. A parameter that is 0 needs one.
    fmu
        As for `prw.simulate`.

    Returns
    -------
    fmu_run.Sensitivities
        found["roll", "k1"], (n,), is the derivative of the roll with respect to k1 at found.time, in SI, and
        found.errors["roll", "k1"] its largest error. To see the effect of 1 %, multiply by 0.01 * found.at["k1"].

    Raises
    ------
    UserError
        A name is unknown, a parameter is at the end of its range or is 0 and has no step, or the FMU rejects a value.
    """
    moved = motion_of(motion)
    with Testbed(None if fmu is None else Path(fmu)) as testbed:
        names = testbed.loaded.outputs if outputs is None else names_of("outputs", outputs)
        given = values_of(values, testbed.loaded)
        testbed.with_starts(given)
        starts: dict[str, Any] = {**testbed.starts, **given}
        chosen = (
            [name for name in testbed.starts if starts[name]]
            if parameters is None
            else names_of("parameters", parameters)
        )
        check_names("parameters", chosen, testbed.starts)
        check_names("outputs", names, testbed.loaded.variables)
        check_names("steps", steps, chosen)
        for name in chosen:
            if float(starts[name]) == testbed.loaded.variables[name].min:
                raise UserError(
                    f"{name} is {starts[name]:g}, the least value that it can have, so it cannot be varied in both directions; choose a "
                    f"larger one, as in values={{{name!r}: 1e-3}}",
                    argument="parameters",
                )
        about: dict[str, Any] = {"outputs": names, "parameters": chosen, "steps": steps}
        try:
            return testbed.loaded.sensitivities(moved.time, **about, **driven_by(moved, given))
        except ValueError as error:
            raise UserError(str(error)) from None
