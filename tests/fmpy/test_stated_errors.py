"""Calls the FMU in the same order as some importers, and compares the errors with those that the documents state for these importers.

The motors move as in Fig. 4, the step is 1 ms, and the errors are in percent of the peak."""

from __future__ import annotations

import re

import numpy as np
import pytest
from built import ROOT
from fmu_run import Fmu
from lagrange import linear_model, table_1
from reference import integrate

H = 1e-3
TIME = H * np.arange(1001)
MOTORS = ("theta1", "theta2", "omega1", "omega2")


def angles(t: float) -> np.ndarray:
    return np.array([1, -1]) * (1 - np.cos(10 * np.pi * t)) / (10 * np.pi)


def rates(t: float) -> np.ndarray:
    return np.array([1, -1]) * np.sin(10 * np.pi * t)


@pytest.fixture(scope="module")
def exact() -> dict[str, np.ndarray]:
    return integrate(linear_model(table_1()), TIME, angles, rates)


def shares(exact, torque, roll) -> tuple[float, float]:
    """Returns the largest errors of torque and roll in percent of the peaks."""
    found = zip((torque, roll), (exact["tau1"], exact["roll"]))
    torque, roll = (100 * np.abs(values - true).max() / np.abs(true).max() for values, true in found)
    return torque, roll


def check_stated(name: str, *parts: str) -> None:
    """Checks that the document contains the parts in this order and close together. All kinds of white space are the same, and tags
    and backticks are ignored."""
    text = re.sub(r"&#8239;|&#160;|\s", " ", (ROOT / name).read_text(encoding="utf-8"))
    text = re.sub(r"<[^>]*>|`", "", text).replace("  ", " ")
    assert re.search(".{0,160}?".join(map(re.escape, parts)), text), parts


def test_outputs_that_are_read_before_inputs_are_set(fmu, exact):
    """FMIKit calls the FMU in this order in Co-Simulation."""
    known = dict(zip(MOTORS, np.array([[*angles(t), *rates(t)] for t in TIME]).T))
    found = {}
    with Fmu(fmu) as testbed:
        for use_omega in (True, False):
            inputs = {name: known[name] for name in MOTORS[: 4 if use_omega else 2]}
            run = testbed.run(
                TIME, inputs=inputs, start={"use_omega": use_omega}, outputs=["tau1", "roll"], read_before_set=True
            ).check()
            found[use_omega] = shares(exact, run["tau1"][0], run["roll"][0])
    with_rates, without = (f"{found[use_omega][0]:.1f} %" for use_omega in (True, False))
    assert max(roll for _, roll in found.values()) < 0.01
    check_stated(
        "docs/compatibility.md", f"torques are off by {with_rates} of their peak", f"by {without} with angles only"
    )
    check_stated("docs/fmu-page/text/testbed/3_loading.html", f"off by {with_rates}", f"{without} with angles only")


def in_model_exchange(
    fmu, nodes, weights, rate_factor: float = 1.0, held: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Integrates with an explicit Runge-Kutta method in which a stage needs only the slope of the previous stage. Returns torque and
    roll. rate_factor: factor of the rates. held: whether inputs are set only once for each step, after the outputs are read."""
    with Fmu(fmu) as testbed:
        instance = testbed.instances(interface="model-exchange")

        def at(t: float, x: np.ndarray) -> None:
            instance.set_time(t)
            instance.set_continuous_states(x)
            if not held:
                instance.set(MOTORS, [[*angles(t), *(rate_factor * rates(t))]])

        x, rows = instance.get_continuous_states(), []
        for t in TIME:
            at(t, x)
            rows.append(instance.get(["tau1", "roll"])[0])
            if held:
                instance.set(MOTORS, [[*angles(t), *(rate_factor * rates(t))]])
            slope, total = 0 * x, 0 * x
            for node, weight in zip(nodes, weights):
                at(t + node * H, x + node * H * slope)
                slope = instance.get_derivatives()
                total = total + weight * slope
            x = x + H * total
    torque, roll = np.array(rows).T
    return torque, roll


ODE4 = (0, 0.5, 0.5, 1), (1 / 6, 1 / 3, 1 / 3, 1 / 6)


def test_fixed_steps_in_model_exchange(fmu, exact):
    """Integrates with the explicit Euler method like OpenModelica, and with ode4 like Simulink with FMIKit."""
    torque, roll = shares(exact, *in_model_exchange(fmu, (0,), (1,)))
    check_stated("docs/compatibility.md", f"off by {roll:.1f} % in roll and", f"{torque:.1f} % in torque")
    check_stated(
        "docs/fmu-page/text/testbed/3_loading.html", f"is {roll:.1f} % off in roll", f"{torque:.1f} % in torque"
    )
    torque, roll = shares(exact, *in_model_exchange(fmu, *ODE4))
    assert roll < torque
    for name in ("docs/compatibility.md", "docs/fmu-page/text/testbed/3_loading.html"):
        check_stated(name, "ode4 at 1 ms", f"{torque:.0e} %".replace("e-0", "e-"))


def test_inputs_that_are_held_over_a_step(fmu, exact):
    """In Model Exchange of FMI 3.0, FMIKit ignores dependencies and sets the inputs once for each step."""
    torque, roll = shares(exact, *in_model_exchange(fmu, *ODE4, held=True))
    check_stated(
        "docs/compatibility.md", "with ode4 at 1 ms", f"torques are off by {torque:.1f} % and roll by {roll:.1f} %"
    )
    check_stated("docs/importers-known-faults.md", "holds the inputs over a step", f"torques are {torque:.1f} % off")


def test_rates_of_zero_in_model_exchange(fmu, exact):
    torque, roll = shares(exact, *in_model_exchange(fmu, *ODE4, rate_factor=0.0))
    for name in ("docs/importers-known-faults.md", "docs/fmu-page/text/testbed/3_loading.html"):
        check_stated(name, "Fig. 4", f"roll is {roll:.0f} %", f"{torque:.0f} %")
