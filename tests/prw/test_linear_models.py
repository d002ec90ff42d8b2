"""`prw.linearize` on FMUs of every kind: beside what pen and paper say of a pendulum, a controller and the testbed."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from lagrange import linear_model, table_1

import prw


def test_a_pendulum_where_it_hangs(pendulum: Path) -> None:
    for start, (angle, k) in (({}, (0.5, 9.0)), ({"angle": 2.0, "stiffness": 4.0, "torque": 7.0}, (2.0, 4.0))):
        model = prw.linearize(start, fmu=pendulum)
        assert (model.states, model.inputs, model.outputs) == (("angle", "rate"), ("torque",), ("angle", "height"))
        np.testing.assert_allclose(model.A, [[0, 1], [-k * np.cos(angle), -1]], rtol=1e-15)
        np.testing.assert_array_equal(model.B, [[0], [1]])
        np.testing.assert_allclose(model.C, [[1, 0], [np.sin(angle), 0]], rtol=1e-15)
        np.testing.assert_array_equal(model.D, [[0], [0]])
        assert dict(model.units) == {"angle": "rad", "rate": "", "torque": "", "height": ""}


def test_the_response_to_sines(pendulum: Path) -> None:
    model, frequency = prw.linearize({"angle": 0.0}, fmu=pendulum), np.array([0.1, 0.5, 2.0])
    s = 2j * np.pi * frequency
    np.testing.assert_allclose(model.response_at_hz(frequency)[:, 0, 0], 1 / (s**2 + s + 9), rtol=1e-12)
    np.testing.assert_allclose(np.sort_complex(model.poles()), np.sort_complex(np.roots([1, 1, 9])), rtol=1e-12)


def test_one_instance_for_many(pendulum: Path) -> None:
    """Also after a refusal, and back at the start values where none are given."""
    with prw.Linearizer(pendulum, outputs=["rate"]) as linearizer:
        for k in (1.0, 16.0):
            assert linearizer.at({"stiffness": k, "angle": 0.0}).A[1, 0] == -k
        with pytest.raises(prw.UserError, match="stiffness: 'soft' is not a value of type"):
            linearizer.at({"stiffness": "soft"})
        with pytest.raises(prw.UserError, match="stiffness: None is not a value of type"):
            linearizer.at({"stiffness": None})
        model = linearizer.at()
        assert model.A[1, 0] == pytest.approx(-9 * np.cos(0.5), rel=1e-15)
        np.testing.assert_array_equal(model.C, [[0, 1]])
    with pytest.raises(prw.UserError, match="is closed"):
        linearizer.at()
    linearizer.close()


def test_a_controller_that_samples(controller: Path) -> None:
    """It has no continuous states; its outputs stay between samples, whatever its inputs do."""
    for interface in ("CoSimulation", "ModelExchange"):
        model = prw.linearize(fmu=controller, fmi_type=interface)
        assert (model.A.shape, model.B.shape) == ((0, 0), (0, 8)) and model.D.shape == (len(model.outputs), 8)
        np.testing.assert_array_equal(model.D, 0)


def test_the_testbed_of_either_version(testbed: Path) -> None:
    parameters = {"k1": 90.0, "c2": 0.3}
    truth = linear_model({**table_1(), **parameters})
    for interface in ("CoSimulation", "ModelExchange"):
        model = prw.linearize(parameters, fmu=testbed, fmi_type=interface)
        np.testing.assert_allclose(model.A, truth.a, rtol=1e-12, atol=1e-10)
        np.testing.assert_allclose(model.B, np.hstack([truth.b_angle, truth.b_rate]), rtol=1e-12, atol=1e-10)


def test_the_rates_move_along(testbed: Path) -> None:
    model, rates = prw.linearize(fmu=testbed), {"omega1": "theta1", "omega2": "theta2"}
    assert model.moved(rates) == ("theta1", "theta2")
    # A motor that stands at 1 rad is followed by its shaft.
    np.testing.assert_allclose(model.response_at_hz(1e-9, rates)[0, model.outputs.index("theta3")], [1, 0], atol=1e-7)
    with pytest.raises(prw.UserError, match="rates: omega9 is no input; there are theta1, theta2"):
        model.transfer(1j, {"omega9": "theta1"})


def test_handed_to_others(testbed: Path) -> None:
    model, s = prw.linearize(fmu=testbed), 3j
    system = model.to_control()
    assert (system.input_labels, system.output_labels) == (list(model.inputs), list(model.outputs))
    np.testing.assert_allclose(system(s), model.transfer(s)[0], rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(model.to_scipy().A, model.A)


def test_what_lacks_derivatives_says_so(lag: Path, pendulum: Path) -> None:
    with pytest.raises(
        prw.UserError, match="no directional derivatives for Model Exchange or Co-Simulation|for Co-Sim"
    ):
        prw.linearize(fmu=lag)
    has, lacks = ("Model Exchange", "CoSimulation")
    if 'fmiVersion="3.0"' in _description(pendulum):
        has, lacks = ("Co-Simulation", "ModelExchange")
    with pytest.raises(prw.UserError, match=f"no directional derivatives for .* is not true\\); it does for {has}"):
        prw.linearize(fmu=pendulum, fmi_type=lacks)


def test_unknown_names(pendulum: Path) -> None:
    with pytest.raises(prw.UserError, match="no start value length; there are torque, stiffness, angle, rate"):
        prw.linearize({"length": 1.0}, fmu=pendulum)
    with pytest.raises(prw.UserError, match="yaw is neither a continuous output nor a state; there are angle, height"):
        prw.linearize(fmu=pendulum, outputs=["yaw"])


def test_an_fmu_in_place_of_the_parameters(testbed: Path) -> None:
    with pytest.raises(
        prw.UserError, match="parameters: .* is no JSON file with values by name; an FMU is named by `fmu`"
    ):
        prw.linearize(testbed)


def _description(fmu: Path) -> str:
    with zipfile.ZipFile(fmu) as archive:
        return archive.read("modelDescription.xml").decode()


def test_each_one_hears_its_own_fmu(testbed: Path, tmp_path: Path) -> None:
    """Also when others are gone. In a process of its own, which a message to one of those would end."""
    program = f"""
import gc, prw
first = prw.Linearizer({str(testbed)!r})
first.at()
for _ in range(3):
    other = prw.Linearizer({str(testbed)!r})
    other.at()
    other.close()
    del other
    gc.collect()
used_again = [bytearray(4096) for _ in range(10000)]
for _ in range(20):
    try:
        first.at({{"k1": -1.0}})
    except prw.UserError as error:
        said = str(error)
print(said)
"""
    result = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0 and "k1 must not be below 1e-300" in result.stdout, result
