"""Controllers of others: the PythonFMU example drives the testbed under every master."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from built import ROOT

from tools.validation import masters, system
from tools.validation.closed_loop import settling_time


@pytest.fixture(scope="module")
def python_loop(tmp_path_factory, fmu):
    pytest.importorskip("pythonfmu")
    folder = tmp_path_factory.mktemp("python")
    source = ROOT / "examples" / "python_controller.py"
    subprocess.run(
        [sys.executable, "-m", "pythonfmu", "build", "-f", source, "-d", folder], check=True, capture_output=True
    )
    build = ["cargo", "run", "--quiet", "--release", "-p", "prw_controller", "--bin", "build_closed_loop", "--"]
    options = ["--testbed", fmu, "--controller", folder / "PythonController.fmu", "--out", folder]
    subprocess.run([*build, *options], check=True, cwd=ROOT, capture_output=True)
    return system.read(folder / "prw_closed_loop.ssp", folder / "prw_closed_loop")


@pytest.fixture(scope="module")
def response(master, python_loop):
    return masters.run_apart(master, python_loop)


def test_it_gets_the_wrist_where_it_shall(response, python_loop):
    for axis in ("pitch", "roll"):
        goal = python_loop.inputs[f"{axis}_ref"][1]
        assert settling_time(response["time"], response[f"testbed.{axis}"], goal) < 0.8


def test_masters_agree(response, python_loop):
    reference = masters.run_apart(masters.MASTERS[0], python_loop)
    for name in ("testbed.pitch", "testbed.roll", "controller.theta1", "controller.theta2"):
        assert np.max(np.abs(response[name] - reference[name])) < 1e-12, name
