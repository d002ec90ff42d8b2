"""`linearize`: the FMU's directional derivatives are eq. (11) and all that follows from it."""

from __future__ import annotations

import numpy as np
import pytest
from lagrange import linear_model, table_1

from prw.errors import UserError
from prw.linearization import linearize
from tools.modes import pitch_and_roll

STATES = ("theta3", "theta4", "theta5", "theta6", "omega5", "omega6")
INPUTS = ("theta1", "theta2", "omega1", "omega2")
RATES = {"omega1": "theta1", "omega2": "theta2"}
#: q of H(s), and the torques.
MEASURED = ("theta3", "theta4", "theta5", "theta6", "tau1", "tau2")


def expected(model, n_over_2m=7 / 8):
    """A, B, C, D of the oracle, for the outputs MEASURED + pitch ... roll_rate."""
    mean, ratio = [0.5, 0.5], [n_over_2m, -n_over_2m]
    pitch_roll = np.zeros((4, 6))
    pitch_roll[0, 2:4], pitch_roll[1, 2:4], pitch_roll[2, 4:], pitch_roll[3, 4:] = mean, ratio, mean, ratio
    c = np.vstack([np.eye(6)[:4], model.c, pitch_roll])
    d = np.zeros((10, 4))
    d[4:6] = np.hstack([model.d_angle, model.d_rate])
    return model.a, np.hstack([model.b_angle, model.b_rate]), c, d


@pytest.mark.parametrize("fmi_type", ["CoSimulation", "ModelExchange"])
@pytest.mark.parametrize("change", [{}, {"J3": 0.05, "k2": 100.0, "c1": 0.1, "N": 9, "M": 2}])
def test_matrices(fmu, fmi_type, change):
    outputs = (*MEASURED, "pitch", "roll", "pitch_rate", "roll_rate")
    found = linearize(change, fmu=fmu, outputs=outputs, fmi_type=fmi_type)
    p = {**table_1(), **change}
    assert (found.states, found.inputs) == (STATES, INPUTS)
    for name, truth in zip("ABCD", expected(linear_model(p), p["N"] / (2 * p["M"]))):
        np.testing.assert_allclose(getattr(found, name), truth, rtol=1e-12, atol=1e-12 * np.abs(truth).max())


def test_names_and_units(fmu):
    model = linearize(fmu=fmu)
    assert (model.A.shape, model.B.shape, model.C.shape, model.D.shape) == ((6, 6), (6, 4), (8, 6), (8, 4))
    assert set(model.outputs) == {"tau1", "tau2", "pitch", "roll", "pitch_rate", "roll_rate", "theta3", "theta4"}
    assert {n: model.units[n] for n in ("theta1", "omega1", "theta5", "omega6", "tau2", "roll_rate")} == {
        "theta1": "rad",
        "omega1": "rad/s",
        "theta5": "rad",
        "omega6": "rad/s",
        "tau2": "N.m",
        "roll_rate": "rad/s",
    }
    assert model.moved({"omega1": "theta1", "omega2": "theta2"}) == ("theta1", "theta2")


def test_the_point_of_operation_does_not_matter(fmu):
    start = {"theta3_start": 1.0, "omega6_start": -30.0, "theta1": 0.5}
    here, there = linearize(fmu=fmu), linearize(start, fmu=fmu)
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(here, name), getattr(there, name))


def test_given_flags_count(fmu):
    """On the first sample the estimated rates are 0, and at rest the states follow the motors."""
    model = linearize({"use_omega": False, "start_at_rest": True}, fmu=fmu, fmi_type="CoSimulation", outputs=["pitch"])
    np.testing.assert_array_equal(model.D, [[0.5, 0.5, 0.0, 0.0]])


def test_transfer_matrices(fmu, model):
    """G(s) of eq. (13) entry by entry from the oracle, and the motors' rates folded in."""
    found = linearize(fmu=fmu, outputs=MEASURED)
    s = 2j * np.pi * np.array([0.1, 3.0, 5.6, 80.0])
    a, b, c, d = expected(model)
    truth = np.array([c[:6] @ np.linalg.inv(si * np.eye(6) - a) @ b + d[:6] for si in s])
    np.testing.assert_allclose(found.transfer(s), truth, rtol=1e-10)
    np.testing.assert_allclose(
        found.transfer(s, RATES), truth[:, :, :2] + s[:, None, None] * truth[:, :, 2:], rtol=1e-9, atol=1e-12
    )
    np.testing.assert_array_equal(found.response_at_hz(s.imag / (2 * np.pi), RATES), found.transfer(s, RATES))


def test_pitch_and_roll_are_apart(fmu):
    p = table_1()
    for mode, inertia, load, gain in zip(
        pitch_and_roll(linearize(fmu=fmu)),
        (p["J2"] + p["H3"] / 2, p["J2"] + p["J3"] * 49 / 32),
        (p["c3"] / 2, p["c3"] * 49 / 32),
        (1, 7 / 4),
    ):
        assert mode.mixing < 1e-10 * np.abs(mode.A).max()
        # det of [c1 + c2, -c2; -c2, c2 + load] s + [k1 + k2, -k2; -k2, k2] with inertia s^2 in the last place
        first, second = np.poly1d([p["c1"] + p["c2"], p["k1"] + p["k2"]]), np.poly1d([p["c2"], p["k2"]])
        poles = (first * (np.poly1d([inertia, p["c2"] + load, p["k2"]])) - second * second).roots
        np.testing.assert_allclose(np.sort_complex(mode.poles()), np.sort_complex(poles), rtol=1e-10)
        np.testing.assert_allclose(np.sort(mode.zeros()), [-p["k1"] / p["c1"], -p["k2"] / p["c2"]], rtol=1e-8)
        assert -mode.c @ np.linalg.solve(mode.A, mode.b) == pytest.approx(gain, rel=1e-12)


def test_to_control(fmu):
    control = pytest.importorskip("control")
    model = linearize(fmu=fmu)
    system = model.to_control()
    assert isinstance(system, control.StateSpace)
    assert (system.input_labels, system.output_labels) == (list(model.inputs), list(model.outputs))
    np.testing.assert_allclose(system(2j), model.transfer(2j)[0], rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize(
    "arguments, complaint",
    [
        ({"outputs": ["yaw"]}, "yaw is neither a continuous output nor a state; there are "),
        ({"parameters": {"k9": 1.0}}, "no start value k9"),
        ({"parameters": {"J2": -1.0}}, "J2"),
        ({"fmi_type": "ScheduledExecution"}, "offers no directional derivatives for ScheduledExecution"),
    ],
)
def test_complaints(fmu, arguments, complaint):
    with pytest.raises(UserError) as caught:
        linearize(fmu=fmu, **arguments)
    assert complaint in str(caught.value) and "\n" not in str(caught.value)


def test_no_fmu(tmp_path):
    (tmp_path / "no.fmu").write_text("not a zip")
    for name, complaint in (("absent.fmu", "no such FMU"), ("no.fmu", "cannot be loaded")):
        with pytest.raises(UserError, match=complaint):
            linearize(fmu=tmp_path / name)
