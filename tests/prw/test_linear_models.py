"""Compares `prw.linearize` with the oracle for the testbed, and with derivatives by hand for a pendulum."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lagrange import OUTPUTS, linear_model, table_1

import prw
from prw.columns import CHANNELS
from tools.modes import pitch_and_roll

STATES = ("theta3", "theta4", "theta5", "theta6", "omega5", "omega6")
INPUTS = ("theta1", "theta2", "omega1", "omega2")
RATES = {"omega1": "theta1", "omega2": "theta2"}
#: The angles q in H(s) of eq. (15), and the torques.
MEASURED = ("theta3", "theta4", "theta5", "theta6", "tau1", "tau2")


def expected(model: Any, n_over_2m: Any = 7 / 8) -> Any:
    """Returns A, B, C, D of the oracle for the outputs MEASURED, pitch, roll, pitch_rate and roll_rate."""
    mean, ratio = [0.5, 0.5], [n_over_2m, -n_over_2m]
    pitch_roll = np.zeros((4, 6))
    pitch_roll[0, 2:4], pitch_roll[1, 2:4], pitch_roll[2, 4:], pitch_roll[3, 4:] = mean, ratio, mean, ratio
    c = np.vstack([np.eye(6)[:4], model.c, pitch_roll])
    d = np.zeros((10, 4))
    d[4:6] = np.hstack([model.d_angle, model.d_rate])
    return model.a, np.hstack([model.b_angle, model.b_rate]), c, d


@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("change", [{}, {"J3": 0.05, "k2": 100.0, "c1": 0.1, "N": 9, "M": 2}])
def test_matrices(testbed: Path, fmi_type: Any, change: Any) -> None:
    outputs = (*MEASURED, "pitch", "roll", "pitch_rate", "roll_rate")
    found = prw.linearize(change, fmu=testbed, outputs=outputs, fmi_type=fmi_type)
    p = {**table_1(), **change}
    assert (found.states, found.inputs) == (STATES, INPUTS)
    for name, true_values in zip("ABCD", expected(linear_model(p), p["N"] / (2 * p["M"]))):
        np.testing.assert_allclose(
            getattr(found, name), true_values, rtol=1e-12, atol=1e-12 * np.abs(true_values).max()
        )


def test_names_and_units(testbed: Path) -> None:
    model = prw.linearize(fmu=testbed)
    assert (model.A.shape, model.B.shape) == ((6, 6), (6, 4)) and set(model.outputs) == {*OUTPUTS}
    assert (model.C.shape, model.D.shape) == ((len(OUTPUTS), 6), (len(OUTPUTS), 4))
    units = {
        "theta1": "rad",
        "omega1": "rad/s",
        "theta5": "rad",
        "omega6": "rad/s",
        "tau2": "N.m",
        "roll_rate": "rad/s",
    }
    assert {name: model.units[name] for name in units} == units


def test_the_point_of_operation_does_not_matter(testbed: Path) -> None:
    """The measured outputs are linear functions of states and inputs."""
    start = {"theta3_start": 1.0, "omega6_start": -30.0, "theta1": 0.5}
    here, there = (prw.linearize(values, fmu=testbed, outputs=CHANNELS) for values in ({}, start))
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))


def test_flags_that_are_given_have_an_effect(testbed: Path) -> None:
    """If use_omega is false, the inputs omega1 and omega2 have no effect. If start_at_rest is true, the states at the start follow the
    motor angles."""
    model = prw.linearize(
        {"use_omega": False, "start_at_rest": True}, fmu=testbed, fmi_type="CoSimulation", outputs=["pitch"]
    )
    np.testing.assert_array_equal(model.D, [[0.5, 0.5, 0.0, 0.0]])


def test_transfer_matrices(testbed: Path) -> None:
    """Compares all entries of G(s), eq. (13), with the oracle; also if the rates follow from the angles."""
    found = prw.linearize(fmu=testbed, outputs=MEASURED)
    s = 2j * np.pi * np.array([0.1, 3.0, 5.6, 80.0])
    a, b, c, d = expected(linear_model(table_1()))
    true_values = np.array([c[:6] @ np.linalg.inv(si * np.eye(6) - a) @ b + d[:6] for si in s])
    np.testing.assert_allclose(found.transfer(s), true_values, rtol=1e-10)
    np.testing.assert_allclose(
        found.transfer(s, RATES),
        true_values[:, :, :2] + s[:, None, None] * true_values[:, :, 2:],
        rtol=1e-9,
        atol=1e-12,
    )
    np.testing.assert_array_equal(found.response_at_hz(s.imag / (2 * np.pi), RATES), found.transfer(s, RATES))
    assert found.moved(RATES) == ("theta1", "theta2")
    with pytest.raises(prw.UserError, match="rates: theta1, whose rate is omega1, is a rate itself"):
        found.response_at_hz(1.0, {"omega1": "theta1", "theta1": "theta2"})
    with pytest.raises(prw.UserError, match="frequency: does not consist of numbers; convert strings"):
        found.response_at_hz(["1", "1_0"])
    with pytest.raises(prw.UserError, match="rates: omega9 is not an input; there are theta1, theta2"):
        found.transfer(1j, {"omega9": "theta1"})


def test_pitch_and_roll_are_separate(testbed: Path) -> None:
    p = table_1()
    for mode, inertia, load, gain in zip(
        pitch_and_roll(prw.linearize(fmu=testbed)),
        (p["J2"] + p["H3"] / 2, p["J2"] + p["J3"] * 49 / 32),
        (p["c3"] / 2, p["c3"] * 49 / 32),
        (1, 7 / 4),
    ):
        assert mode.mixing < 1e-10 * np.abs(mode.A).max()
        # The poles are the roots of det([c1 + c2, -c2; -c2, c2 + load] s + [k1 + k2, -k2; -k2, k2]), with inertia s^2 added to the
        # last entry.
        first, second = np.poly1d([p["c1"] + p["c2"], p["k1"] + p["k2"]]), np.poly1d([p["c2"], p["k2"]])
        poles = (first * (np.poly1d([inertia, p["c2"] + load, p["k2"]])) - second * second).roots
        np.testing.assert_allclose(np.sort_complex(mode.poles()), np.sort_complex(poles), rtol=1e-10)
        np.testing.assert_allclose(np.sort(mode.zeros()), [-p["k1"] / p["c1"], -p["k2"] / p["c2"]], rtol=1e-8)
        assert -mode.c @ np.linalg.solve(mode.A, mode.b) == pytest.approx(gain, rel=1e-12)


def test_a_pendulum_at_any_angle(pendulum: Path) -> None:
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
    """A Linearizer can be used after an error, and uses the FMU's start values if none are given."""
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
    """The controller has no continuous states, and between samples its outputs do not depend on its inputs."""
    for interface in ("CoSimulation", "ModelExchange"):
        model = prw.linearize(fmu=controller, fmi_type=interface)
        assert (model.A.shape, model.B.shape) == ((0, 0), (0, 8)) and model.D.shape == (len(model.outputs), 8)
        np.testing.assert_array_equal(model.D, 0)


def test_conversions(testbed: Path) -> None:
    model, s = prw.linearize(fmu=testbed), 3j
    system = model.to_control()
    assert (system.input_labels, system.output_labels) == (list(model.inputs), list(model.outputs))
    np.testing.assert_allclose(system(s), model.transfer(s)[0], rtol=1e-10, atol=1e-12)
    np.testing.assert_array_equal(model.to_scipy().A, model.A)


def test_an_fmu_without_derivatives_is_an_error(lag: Path, pendulum: Path) -> None:
    with pytest.raises(
        prw.UserError, match="no directional derivatives for Model Exchange or Co-Simulation|for Co-Sim"
    ):
        prw.linearize(fmu=lag)
    has, lacks = ("Model Exchange", "CoSimulation")
    if 'fmiVersion="3.0"' in _description(pendulum):
        has, lacks = ("Co-Simulation", "ModelExchange")
    with pytest.raises(prw.UserError, match=f"no directional derivatives for .* is not true\\); it does for {has}"):
        prw.linearize(fmu=pendulum, fmi_type=lacks)


def _description(fmu: Path) -> str:
    with zipfile.ZipFile(fmu) as archive:
        return archive.read("modelDescription.xml").decode()


@pytest.mark.parametrize(
    "arguments, message",
    [
        ({"outputs": ["yaw"]}, "yaw is neither a continuous output nor a state; there are tau1, tau2"),
        ({"parameters": {"k9": 1.0}}, "no start value k9; there are "),
        ({"parameters": {"J2": -1.0}}, "J2"),
        ({"fmi_type": "ScheduledExecution"}, "offers no directional derivatives for ScheduledExecution"),
    ],
)
def test_errors(testbed: Path, arguments: Any, message: Any) -> None:
    with pytest.raises(prw.UserError) as caught:
        prw.linearize(fmu=testbed, **arguments)
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_no_fmu(tmp_path: Path) -> None:
    (tmp_path / "no.fmu").write_text("not a zip")
    for name, message in (("absent.fmu", "no such FMU"), ("no.fmu", "cannot be loaded")):
        with pytest.raises(prw.UserError, match=message):
            prw.linearize(fmu=tmp_path / name)


def test_an_fmu_in_place_of_the_parameters(testbed: Path) -> None:
    with pytest.raises(
        prw.UserError, match="parameters: .* is not a JSON file with values by name; if it is an FMU, pass it as `fmu`"
    ):
        prw.linearize(testbed)


def test_each_one_gets_the_messages_of_its_own_fmu(testbed: Path, tmp_path: Path) -> None:
    """A Linearizer gets the messages of its FMU also after other Linearizers are closed. A message to a closed one could crash the
    process, so the test runs in a separate process."""
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
        reported = str(error)
print(reported)
"""
    result = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0 and "k1 must be above 0, it is -1" in result.stdout, result
