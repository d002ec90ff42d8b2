"""fmu-manipulation-toolbox: its check of an FMU, and the closed loop as one FMU."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import fmpy
import numpy as np
from built import built, needed

needed("fmu_manipulation_toolbox", "fmu-manipulation-toolbox")

from prw.checking.agreement import compare  # noqa: E402
from prw.checking.experiments import find, read_experiments  # noqa: E402
from prw.checking.result import Result  # noqa: E402

TOOLBOX = "fmu-manipulation-toolbox"


def toolbox(command: str, *arguments: str, directory: Path) -> str:
    """Returns the output of a command of the toolbox."""
    code = f"import sys; from fmu_manipulation_toolbox.cli.{command} import {command}; sys.argv[0] = {command!r}; {command}()"
    process = subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=directory, capture_output=True, text=True, timeout=120
    )
    output = process.stdout + process.stderr
    assert process.returncode == 0, output
    return output


def test_fmutool_reports_no_error(testbed, version, stated):
    output = toolbox("fmutool", "-input", str(testbed), "-check", directory=testbed.parent)
    verdict = f"No semantic error against the FMI-{'3' if version else '2'} standard."
    assert verdict in output and "ERROR" not in output.replace("semantic error", "")
    stated("fmutool", TOOLBOX, "`fmutool -check`: “No semantic error”")


def test_the_closed_loop_as_one_fmu(closed_loop, tmp_path, stated):
    """The container is an FMU that steps the FMUs in it; FMPy runs the container."""
    (tmp_path / closed_loop.name).write_bytes(closed_loop.read_bytes())
    toolbox("fmucontainer", "-container", f"{closed_loop.name}:0.001", "-auto-local", directory=tmp_path)
    container = tmp_path / "prw_closed_loop.fmu"
    goals = {"pitch_ref": np.deg2rad(30.0), "roll_ref": np.deg2rad(60.0)}
    outputs = [
        v.name for v in fmpy.read_model_description(str(container)).modelVariables if v.name.startswith("prw_testbed.")
    ]
    rows = fmpy.simulate_fmu(
        str(container), stop_time=1.0, step_size=1e-3, output_interval=1e-3, start_values=goals, output=outputs
    )
    experiment = find(read_experiments(built("prw_testbed.fmu")), "closed_loop")
    values = {name.removeprefix("prw_testbed."): rows[name] for name in outputs}
    agreement = compare(Result(container, rows["time"], values), experiment, "CoSimulation")
    assert agreement.agrees, agreement.summary()
    share = max(difference.largest / difference.allowed for difference in agreement.variables.values())
    assert share < 0.6 and len(agreement.variables) == 6
    stated("FMU containers", TOOLBOX, "the loop agrees with the reference experiment")
