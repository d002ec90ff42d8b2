"""prw_motor.fmu and the testbed, connected both ways, compared with the machine of tests/oracle/machine.py."""

from __future__ import annotations

import re

import machine
import numpy as np
import pytest
from built import ROOT, built
from fmu_run import Fmu, System
from lagrange import table_1
from scipy.integrate import solve_ivp

from tools.documentation.sources import read_table

J1 = 1.5e-3
FROM_MOTORS, FROM_WRIST = ("theta1", "theta2", "omega1", "omega2"), ("tau1", "tau2")
END = 0.3


def torque(t):
    return np.array([0.6 * np.sin(20 * t), -0.4 * np.sin(30 * t)])


def exact(time: np.ndarray) -> machine.Trajectory:
    found = machine.pushed(time, table_1(), J1, torque)
    assert np.abs(found.tau).max() > 0.1 and np.abs(found.roll).max() > 0.1
    return found


@pytest.mark.parametrize("version, order", [("", "dependencies"), ("fmi3/", "jacobi")])
def test_held_torques_cause_a_first_order_error(version, order):
    """The order of the error does not depend on when a master reads the torques. Masters that exchange all values at the end of a
    step (Jacobi), such as FMPy and libcosim, read the torques before they set the new angles."""
    connections = {f"motors.{name}": f"wrist.{name}" for name in FROM_MOTORS}
    connections |= {f"wrist.{name}": f"motors.{name}" for name in FROM_WRIST}
    fmus = {"motors": built(f"{version}prw_motor.fmu"), "wrist": built(f"{version}prw_testbed.fmu")}
    outputs, errors = ["wrist.tau1", "wrist.tau2", "wrist.pitch", "wrist.roll", "motors.omega1"], []
    with System(fmus, connections, order=order) as loop:
        for h in (0.5e-3, 0.25e-3):
            time = h * np.arange(round(END / h) + 1)
            inputs = dict(zip(("motors.torque1", "motors.torque2"), np.array([torque(t) for t in time]).T))
            start = {"wrist.use_omega": True, "motors.J1": J1}
            run = loop.run(time, inputs=inputs, start=start, outputs=outputs).check()
            true = exact(time)
            expected = (*true.tau.T, true.pitch, true.roll, true.omega[:, 0])
            errors.append([np.abs(run[name][0] - y).max() / np.abs(y).max() for name, y in zip(outputs, expected)])
    coarse, fine = np.array(errors)
    assert np.all(fine < 0.01), fine
    rate = np.log2(coarse / fine)
    # In the errors of the angles, second-order parts are not yet negligible.
    assert rate[:2] == pytest.approx(1, abs=0.15) and np.all((rate > 0.9) & (rate < 2)), rate


def with_slopes(slope: str) -> float:
    """Returns the largest error of the torques in percent, with steps of 1 ms. slope: how the motors extrapolate the wrist's torque."""
    h, rows = 1e-3, []
    time = h * np.arange(round(END / h) + 1)
    with Fmu(built("prw_motor.fmu")) as motor, Fmu(built("prw_testbed.fmu")) as testbed:
        motors, wrist = motor.instances(start={"J1": J1}), testbed.instances(start={"use_omega": True})
        for t in time:
            wrist.set(FROM_MOTORS, motors.get(FROM_MOTORS))
            rows.append(wrist.get(FROM_WRIST)[0])
            motors.set((*FROM_WRIST, "torque1", "torque2"), [[*rows[-1], *torque(t)]])
            own = (torque(t + 1e-6) - torque(t - 1e-6)) / 2e-6
            slopes = {
                "0": np.zeros(2),
                "output derivatives": wrist.get_output_derivatives(FROM_WRIST)[0],
                "last two": (rows[-1] - rows[max(len(rows) - 2, 0)]) / h,
            }
            motors.set_input_derivatives((*FROM_WRIST, "torque1", "torque2"), [[*slopes[slope], *own]])
            motors.step(h)
            wrist.step(h)
    true = exact(time).tau
    return float(100 * (np.abs(np.array(rows) - true).max(axis=0) / np.abs(true).max(axis=0)).max())


def test_slopes_of_the_torque_in_the_document():
    rows = read_table(ROOT / "docs/compatibility.md", "Motors driven by torque").rows
    text = (ROOT / "docs/compatibility.md").read_text(encoding="utf-8")
    assert len(rows) == 5  # The first table of the section is the example's; the second is read below.
    stated = dict(re.findall(r"^\| (0|output derivatives|through the last two).*? \| ([\d.]+ %) \|$", text, flags=re.M))
    found = {name: f"{with_slopes(name.removeprefix('through the ')):.2f} %" for name in stated}
    assert len(stated) == 3 and found == stated


def test_model_exchange_needs_no_communication_points():
    """One solver integrates both FMUs, whose variables are connected directly."""
    with Fmu(built("prw_motor.fmu")) as motor, Fmu(built("prw_testbed.fmu")) as testbed:
        motors = motor.instances(interface="model-exchange", start={"J1": J1})
        wrist = testbed.instances(interface="model-exchange")

        def slope(t: float, x: np.ndarray) -> np.ndarray:
            for instance, states in ((motors, x[:4]), (wrist, x[4:])):
                instance.set_time(t)
                instance.set_continuous_states([states])
            wrist.set(FROM_MOTORS, motors.get(FROM_MOTORS))
            motors.set((*FROM_WRIST, "torque1", "torque2"), [[*wrist.get(FROM_WRIST)[0], *torque(t)]])
            return np.concatenate([motors.get_derivatives()[0], wrist.get_derivatives()[0]])

        time = np.linspace(0, END, 31)
        found = solve_ivp(slope, (0, END), np.zeros(10), "LSODA", time, rtol=1e-10, atol=1e-12)
    expected = exact(time)
    order = [name for name, _ in motor.derivatives.items()]
    states = dict(zip(order, found.y[:4]))
    for k in (0, 1):
        np.testing.assert_allclose(states[f"theta{k + 1}"], expected.theta[:, k], rtol=0, atol=1e-9)
        np.testing.assert_allclose(states[f"omega{k + 1}"], expected.omega[:, k], rtol=0, atol=1e-7)


def test_the_program_in_the_readme(monkeypatch):
    built("prw_motor.fmu")
    monkeypatch.chdir(ROOT)
    readme = (ROOT / "examples/motor/README.md").read_text(encoding="utf-8")
    (program,) = re.findall(r"^```python\n(.*?)^```$", readme, flags=re.M | re.S)
    found: dict = {}
    exec(program, found)
    expected = machine.pushed(found["time"], table_1(), 2e-3, lambda t: 0.5 * np.sin(20 * t) * np.array([1, -1]))
    np.testing.assert_allclose(found["run"]["wrist.roll"][0], expected.roll, rtol=0, atol=0.01 * expected.roll.max())
