"""`tools closed-loop` and the example FMU to copy."""

from __future__ import annotations

import subprocess
import sys

import fmpy
import numpy as np
import pytest
from built import FMUS, ROOT, built
from fmpy.validation import validate_fmu

from tools.documentation.sources import read_table
from tools.validation import masters


def tools(*arguments):
    command = [sys.executable, "-m", "tools", "closed-loop", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT)


def test_it_writes_figures_and_tables_and_says_what_it_saw(closed_loop, tmp_path):
    run = tools("--fmus", str(FMUS), "--out", str(tmp_path))
    assert run.returncode == 0, run.stderr
    for text in ("pitch_ref 30 deg, roll_ref 60 deg", "within 0.1 deg after", "FMPy", "with input derivatives"):
        assert text in run.stdout, run.stdout
    table = np.genfromtxt(tmp_path / "closed_loop.csv", delimiter=",", names=True)
    assert len(table) == closed_loop.steps and "testbedpitch" in "".join(table.dtype.names).replace("_", "")
    for name in ("closed_loop.png", "coupling.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_what_is_missing_is_named(tmp_path):
    run = tools("--fmus", str(tmp_path))
    assert run.returncode == 1 and run.stderr.count("\n") == 1
    assert "prw_closed_loop.ssp: no such file; `make closed-loop` builds it" in run.stderr


def test_the_compatibility_table_names_the_versions_that_run_here():
    rows = read_table(ROOT / "docs/compatibility.md", "At a glance").rows
    for master in masters.MASTERS:
        if master.version() is not None:
            assert any(master.name in tool and master.version() in tool for tool, *_ in rows), master.name


@pytest.mark.parametrize("interface", ["CoSimulation", "ModelExchange"])
def test_the_example_to_copy_works(interface):
    """lag.fmu: x' = u - x."""
    fmu = str(built("lag.fmu"))
    assert validate_fmu(fmu) == []
    result = fmpy.simulate_fmu(
        fmu, fmi_type=interface, stop_time=2, output_interval=0.1, start_values={"u": 1.0}, relative_tolerance=1e-8
    )
    np.testing.assert_allclose(
        result["x"], 1 - np.exp(-result["time"]), atol=1e-14 if interface == "CoSimulation" else 1e-6
    )
