"""prw_controller.fmu under FMPy, and coupled to the testbed while its references jump."""

from __future__ import annotations

import fmpy
import fmu_run
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from instance import Instance

MOTORS = ("theta1", "theta2", "omega1", "omega2")
STEP = 1e-3


@pytest.fixture
def start(controller_fmu, unpack):
    """Returns a function that creates and initializes a controller with the given start values."""
    instances = []

    def start(**values) -> Instance:
        description = fmpy.read_model_description(controller_fmu)
        instances.append(Instance(unpack(controller_fmu), description, "prw_controller"))
        instances[-1].fmi.setupExperiment(startTime=0.0)
        instances[-1].set(**values)
        instances[-1].fmi.enterInitializationMode()
        instances[-1].fmi.exitInitializationMode()
        return instances[-1]

    yield start
    for instance in instances:
        instance.free()


def moved_by_fmpy(fmu, **options) -> np.ndarray:
    """Returns the motion of the motors (samples, 4) at each sample. All inputs are linear in time, so importers interpolate them
    exactly."""
    time = np.arange(0.0, 1.0 + STEP / 2, STEP)
    slopes = {
        "pitch_ref": 0.5,
        "roll_ref": -0.8,
        "pitch": 0.3,
        "roll": -0.6,
        "pitch_rate": 0.1,
        "tau1": 0.2,
        "tau2": 0.1,
    }
    inputs = np.zeros(len(time), dtype=[("time", float), *((name, float) for name in (*slopes, "roll_rate"))])
    inputs["time"] = time
    for name, slope in slopes.items():
        inputs[name] = slope * time
    result = fmpy.simulate_fmu(
        str(fmu), stop_time=1.0, output_interval=STEP, step_size=STEP, input=inputs, output=MOTORS, **options
    )
    moments = np.round(result["time"] / STEP).astype(int)
    # An event has two rows, before and after it; the motion is equal in both.
    last = np.searchsorted(moments, np.arange(len(time)), side="right") - 1
    return np.array([[row[name] for name in MOTORS] for row in result[last]])


@pytest.mark.parametrize(
    "options",
    [
        {"fmi_type": "ModelExchange", "solver": "CVode"},
        {"fmi_type": "CoSimulation", "use_event_mode": True, "early_return_allowed": True},
    ],
    ids=["model exchange", "event mode"],
)
def test_samples_are_events_that_fmpy_handles(controller, options):
    """The motors move as in Co-Simulation without events."""
    expected = moved_by_fmpy(controller, fmi_type="CoSimulation")
    assert np.abs(expected).max(axis=0).min() > 0.05
    if "use_event_mode" in options and "fmi3" not in str(controller):
        pytest.skip("FMI 2.0 has no Event Mode in Co-Simulation")
    moved = moved_by_fmpy(controller, **options)
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-13)


def test_a_jumping_reference_is_followed_within_limits(closed_loop):
    goals, time = np.deg2rad([[30, 60], [-30, 60], [0, -90], [10, 0]]), STEP * np.arange(4001)
    inputs = dict(zip(("pitch_ref", "roll_ref"), goals[np.minimum(time.astype(int), 3)].T))
    names = ["testbed.pitch", "testbed.roll", *(f"controller.{name}" for name in MOTORS)]
    with fmu_run.System(closed_loop.ssp) as loop:
        runs = loop.run(time, inputs=inputs, outputs=names).check()
    wrist, motors = np.hsplit(np.column_stack([runs[name][0] for name in names]), [2])
    for k, goal in enumerate(goals):
        end = (time > k + 0.9) & (time < k + 1.0)
        assert np.max(np.abs(np.rad2deg(wrist[end] - goal))) < 0.1
    assert np.max(np.abs(motors[:, 2:])) <= 3 + 1e-9
    assert np.max(np.abs(np.diff(motors[:, 2:], axis=0))) <= 30 * STEP * (1 + 1e-6)
    # Between two samples, one step apart, theta is a parabola and omega its derivative, so this rule is exact.
    moved, mean = np.diff(motors[:, :2], axis=0), STEP * (motors[1:, 2:] + motors[:-1, 2:]) / 2
    np.testing.assert_allclose(moved, mean, atol=1e-14)


def test_output_derivatives_are_derivatives_of_the_motion(start):
    controller = start(pitch_ref=0.5)
    controller.step(0.0, 2.5e-3)
    references = [controller.variables[name].valueReference for name in MOTORS]
    first = controller.fmi.getRealOutputDerivatives(references, [1] * 4)
    np.testing.assert_allclose(first, [*controller.get("omega1", "omega2"), 30.0, 30.0])
    # The order 2 exceeds maxOutputDerivativeOrder, so the FMU rejects it.
    with pytest.raises(FMICallException):
        controller.fmi.getRealOutputDerivatives(references[:2], [2, 2])


def test_motors_start_at_their_given_angles(start):
    controller = start(theta1=0.7, theta2=0.7, pitch_ref=0.7, pitch=0.7)
    for k in range(100):
        controller.step(k * STEP, STEP)
    np.testing.assert_array_equal(controller.get(*MOTORS), [0.7, 0.7, 0.0, 0.0])
