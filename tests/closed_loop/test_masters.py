"""The closed loop under third-party masters: settling, limits, agreement, and the order of the coupling's error."""

from __future__ import annotations

import subprocess
import sys

import fmu_run
import numpy as np
import pytest
from built import ROOT, program

from tools.validation import coupling, masters, system
from tools.validation.closed_loop import settling_time


def by_fmu_run(closed_loop, starts_late: bool) -> np.ndarray:
    """Returns the variables that masters record, (steps, len(RECORDED)), from fmu_run in the masters' order of calls."""
    with fmu_run.System(closed_loop.ssp, order="jacobi") as loop:
        if not starts_late:
            # libcosim counts nanoseconds, and converts them to seconds in each step.
            time = np.arange(closed_loop.steps + 1) * round(closed_loop.step * 1e9) / 1e9
            runs = loop.run(time, outputs=masters.RECORDED)
            return np.column_stack([runs[name][0, 1:] for name in masters.RECORDED])
        # FMPy sets the inputs of the system only after its first step, and adds up the step sizes to get the time.
        goals = {name: value for name, (_, value) in closed_loop.inputs.items()}
        one = loop.instances(start=dict.fromkeys(goals, 0.0))
        one.step(closed_loop.step)
        one.set(tuple(goals), list(goals.values()))
        rows = []
        for _ in range(closed_loop.steps):
            one.step(closed_loop.step)
            rows.append(one.get(masters.RECORDED)[0])
        return np.array(rows)


@pytest.fixture(scope="module")
def response(master, closed_loop):
    return masters.run_separately(master, closed_loop)


def test_there_are_at_least_two_masters():
    installed = [master for master in masters.MASTERS if master.version()]
    if masters.MASTERS[1].version() is None:
        pytest.skip("libcosim has no package for this Python version or platform")
    assert len(installed) >= 2


def test_the_wrist_reaches_the_reference(response, closed_loop):
    """After less than 0.6 s, pitch stays within 0.1 degrees of 30 degrees, and roll within 0.1 degrees of 60 degrees."""
    for axis in ("pitch", "roll"):
        goal = closed_loop.inputs[f"{axis}_ref"][1]
        assert settling_time(response["time"], response[f"testbed.{axis}"], goal) < 0.6
        assert np.rad2deg(np.max(np.abs(response[f"testbed.{axis}"])) - goal) < 0.5


def test_the_motors_keep_their_limits(response, closed_loop):
    for i in (1, 2):
        rate = response[f"controller.omega{i}"]
        assert np.max(np.abs(rate)) <= 3 + 1e-9
        assert np.max(np.abs(np.diff(rate))) <= 30 * closed_loop.step * (1 + 1e-6)
        assert np.max(np.abs(response[f"testbed.tau{i}"])) < 10


def test_systems_of_fmu_run_agree_with_all_masters(master, response, closed_loop):
    """All masters use Jacobi's method. FMPy and libcosim are bit-identical to fmu_run. Ecos and sofirpy have other rounding errors, and read
    the torques, which depend directly on inputs, after they have set the next inputs. So torques are not compared for these two."""
    own = by_fmu_run(closed_loop, starts_late=master.name == "FMPy")
    for name, column in zip(masters.RECORDED, own.T):
        if master.name not in ("Ecos", "sofirpy"):
            assert np.array_equal(response[name], column), name
        elif "tau" not in name:
            # An omega is a difference of angles divided by a step, so it loses three digits.
            assert np.max(np.abs(response[name] - column)) < (1e-10 if "omega" in name else 1e-13), name


@pytest.fixture(scope="module")
def python_loop(tmp_path_factory, fmu):
    pytest.importorskip("pythonfmu")
    directory = tmp_path_factory.mktemp("python")
    source = ROOT / "examples" / "python_controller.py"
    subprocess.run(
        [sys.executable, "-m", "pythonfmu", "build", "-f", source, "-d", directory], check=True, capture_output=True
    )
    build = program("build_closed_loop", "prw_controller")
    options = ["--testbed", fmu, "--controller", directory / "PythonController.fmu", "--out", directory]
    subprocess.run([*build, *options], check=True, cwd=ROOT, capture_output=True)
    return system.read(directory / "prw_closed_loop.ssp", directory / "prw_closed_loop")


@pytest.fixture(scope="module")
def python_response(master, python_loop):
    return masters.run_separately(master, python_loop)


def test_the_python_controller_settles(python_response, python_loop):
    for axis in ("pitch", "roll"):
        goal = python_loop.inputs[f"{axis}_ref"][1]
        assert settling_time(python_response["time"], python_response[f"testbed.{axis}"], goal) < 0.8


def test_masters_agree_on_the_python_controller(python_response, python_loop):
    reference = masters.run_separately(masters.MASTERS[0], python_loop)
    for name in ("testbed.pitch", "testbed.roll", "controller.theta1", "controller.theta2"):
        assert np.max(np.abs(python_response[name] - reference[name])) < 1e-12, name


@pytest.fixture(scope="module")
def study(closed_loop):
    return coupling.study(closed_loop)


def test_up_to_the_sample_time_derivatives_change_nothing_and_the_order_is_two(study):
    """The controller reads exact samples. An error remains because within a step the motor angles are parabolas, but the testbed
    assumes straight lines."""
    fine = study.step <= 1.001e-3
    np.testing.assert_allclose(study.held[fine], study.derivatives[fine], rtol=1e-6)
    order = np.diff(np.log(study.held[fine])) / np.diff(np.log(study.step[fine]))
    assert np.all((order > 1.9) & (order < 2.1)), order
    assert study.held[fine][-1] < 1e-3


def test_beyond_the_sample_time_derivatives_keep_the_order(study):
    coarse = (study.step >= 0.999e-3) & (study.step <= 8.001e-3)
    step, held, derivatives = study.step[coarse], study.held[coarse], study.derivatives[coarse]
    order = np.diff(np.log(derivatives)) / np.diff(np.log(step))
    assert np.all((order > 1.8) & (order < 2.2)), order
    # With held inputs, samples inside a step use old values, so the error is first order.
    assert np.all(held[1:] > 1.5 * derivatives[1:])
    order = np.diff(np.log(held[1:])) / np.diff(np.log(step[1:]))
    assert np.all(order < 1.8), order
