"""The closed loop with both FMUs in Model Exchange, where the controller's samples are time events.

The classical Runge-Kutta method integrates the testbed between samples. The Co-Simulation results must converge to this
solution as the communication step decreases."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
import pytest
from fmu_run import Fmu

from tools.validation import coupling
from tools.validation.system import System

SAMPLE, SAMPLES = 1e-3, 480
MEASURED = ("pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2")
MOTORS = ("theta1", "theta2", "omega1", "omega2")
WATCHED = ("testbed.pitch", "testbed.roll", "testbed.tau1", "controller.theta1")


def run(system: System, steps: int) -> np.ndarray:
    """Returns the watched variables at each sample, shape (SAMPLES + 1, len(WATCHED)), with `steps` integrator steps between two
    samples.

    Between samples the motors' motion depends only on time, so there is no algebraic loop."""
    references = {end.split(".")[1]: value for end, value in system.inputs.values()}
    with ExitStack() as stack:
        fmus = {name: stack.enter_context(Fmu(system.osp / file)) for name, file in system.fmus.items()}
        testbed = fmus["testbed"].instances(interface="model-exchange")
        controller = fmus["controller"].instances(interface="model-exchange", start=references)
        instances = {"testbed": testbed, "controller": controller}

        def move(time: float) -> None:
            testbed.set_time(time)
            controller.set_time(time)
            testbed.set(MOTORS, controller.get(MOTORS))

        def slope(time: float, x: np.ndarray) -> np.ndarray:
            move(time)
            testbed.set_continuous_states(x)
            return testbed.get_derivatives()

        rows, time, h = [], 0.0, SAMPLE / steps
        for k in range(SAMPLES + 1):
            move(time)
            rows.append([instances[end.split(".")[0]].get(end.split(".")[1])[0] for end in WATCHED])
            if k:
                controller.handle_events(MEASURED, testbed.get(MEASURED))
            assert controller.next_event_time[0] == pytest.approx((k + 1) * SAMPLE, rel=1e-12)
            x = testbed.get_continuous_states()
            for t in time + h * np.arange(steps):
                k1 = slope(t, x)
                k2 = slope(t + h / 2, x + h / 2 * k1)
                k3 = slope(t + h / 2, x + h / 2 * k2)
                k4 = slope(t + h, x + h * k3)
                x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            testbed.set_continuous_states(x)
            testbed.completed_integrator_step()
            time = controller.next_event_time[0]
        return np.array(rows)


@pytest.fixture(scope="module")
def exact(closed_loop: System) -> np.ndarray:
    """The response with a step size so small that doubling it changes the result by less than 1e-9."""
    coarse, fine = run(closed_loop, 8), run(closed_loop, 16)
    assert np.abs(fine - coarse).max() < 1e-9
    pitch, roll, torque, motor = np.abs(fine).max(axis=0)
    assert pitch > 0.5 and roll > 1.0 and torque > 0.5 and motor > 1.0, "the system hardly moves"
    return fine


def test_co_simulation_converges_to_model_exchange(exact, closed_loop: System):
    """The error of the angles is second order in the communication step. A sample period is an integer number of steps."""

    def error(steps: int) -> np.ndarray:
        rows = coupling.couple(closed_loop, SAMPLE / steps, SAMPLE * SAMPLES, False, WATCHED)[::steps]
        return np.abs(rows - exact).max(axis=0)

    coarse, fine = error(8), error(16)
    angles = [WATCHED.index(name) for name in ("testbed.pitch", "testbed.roll", "controller.theta1")]
    assert np.all(fine[angles] < 1e-7), fine
    order = np.log2(coarse / fine)
    assert np.all((order[angles] > 1.9) & (order[angles] < 2.1)), (coarse, fine)
