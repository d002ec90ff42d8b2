"""prw_controller.fmu at the FMI boundary, and with a testbed whose sensors or references are out of order."""

from __future__ import annotations

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from instance import Instance

MEASURED = ("pitch", "roll", "pitch_rate", "roll_rate", "tau1", "tau2")
MOTORS = ("theta1", "theta2", "omega1", "omega2")
STEP = 1e-3


@pytest.fixture(scope="module")
def folders(fmu, controller_fmu, unpack):
    return {each.stem: unpack(each) for each in (fmu, controller_fmu)}


@pytest.fixture
def make(folders):
    instances = []

    def make(name: str) -> Instance:
        instances.append(Instance(folders[name], fmpy.read_model_description(folders[name]), name))
        return instances[-1]

    yield make
    for instance in instances:
        instance.free()


@pytest.fixture
def controller(make):
    return make("prw_controller")


def start(instance: Instance, **values) -> None:
    instance.fmi.setupExperiment(startTime=0.0)
    instance.set(**values)
    instance.fmi.enterInitializationMode()
    instance.fmi.exitInitializationMode()


def run(make, duration: float, reference, measure=lambda t, values: values, **parameters):
    """Controller and testbed, step by step. reference(t): (2,) rad; measure(t, values) may spoil what the testbed says.
    Returns time (n,), pitch and roll (n, 2) rad, motors (n, 4)."""
    testbed, controller = make("prw_testbed"), make("prw_controller")
    start(testbed, use_omega=True)
    start(controller, **parameters)
    wrist, motors, n = [], [], round(duration / STEP)
    for k in range(n):
        t = k * STEP
        values = dict(zip(MEASURED, testbed.get(*MEASURED)))
        motion = dict(zip(MOTORS, controller.get(*MOTORS)))
        controller.set(**dict(zip(("pitch_ref", "roll_ref"), reference(t))), **measure(t, values))
        testbed.set(**motion)
        controller.step(t, STEP)
        testbed.step(t, STEP)
        wrist.append(testbed.get("pitch", "roll"))
        motors.append(controller.get(*MOTORS))
    assert not testbed.complaints() and not controller.complaints()
    return STEP * np.arange(1, n + 1), np.array(wrist), np.array(motors)


@pytest.fixture(scope="module", params=["fmi2", "fmi3"])
def either_fmu(request, controller_fmu):
    """The controller's FMU for FMI 2.0 and for FMI 3.0."""
    return controller_fmu if request.param == "fmi2" else controller_fmu.parent / "fmi3" / controller_fmu.name


def test_the_validator_has_nothing_to_say(either_fmu):
    assert validate_fmu(str(either_fmu)) == []


def moved_by_fmpy(fmu, **options) -> np.ndarray:
    """The motors' motion (samples, 4) at each sample; all inputs follow a straight line, which every importer knows."""
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
    # Before and after an event there are two rows; the motion is the same in both.
    last = np.searchsorted(moments, np.arange(len(time)), side="right") - 1
    return np.array([[row[name] for name in MOTORS] for row in result[last]])


@pytest.mark.parametrize("solver", ["Euler", "CVode"])
def test_model_exchange_moves_the_motors_as_co_simulation_does(either_fmu, solver):
    expected = moved_by_fmpy(either_fmu, fmi_type="CoSimulation")
    assert np.abs(expected).max(axis=0).min() > 0.05
    moved = moved_by_fmpy(either_fmu, fmi_type="ModelExchange", solver=solver)
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-13)


def test_the_samples_are_events_that_fmpy_handles(controller_fmu):
    fmu = controller_fmu.parent / "fmi3" / controller_fmu.name
    expected = moved_by_fmpy(fmu, fmi_type="CoSimulation")
    moved = moved_by_fmpy(fmu, fmi_type="CoSimulation", use_event_mode=True, early_return_allowed=True)
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-13)
    fmpy.read_model_description(str(controller_fmu), validate=True)


def test_a_reference_that_jumps_to_and_fro_is_followed_within_limits(make):
    goals = np.deg2rad([[30, 60], [-30, 60], [0, -90], [10, 0]])
    time, wrist, motors = run(make, 4.0, lambda t: goals[int(t)])
    for k, goal in enumerate(goals):
        end = (time > k + 0.9) & (time < k + 1.0)
        assert np.max(np.abs(np.rad2deg(wrist[end] - goal))) < 0.1
    assert np.max(np.abs(motors[:, 2:])) <= 3 + 1e-9
    assert np.max(np.abs(np.diff(motors[:, 2:], axis=0))) <= 30 * STEP * (1 + 1e-6)
    # omega is the derivative of theta: between samples, which are a step apart, exactly.
    moved, mean = np.diff(motors[:, :2], axis=0), STEP * (motors[1:, 2:] + motors[:-1, 2:]) / 2
    np.testing.assert_allclose(moved, mean, atol=1e-14)


def test_it_finds_its_way_with_wrong_gear_numbers_in_the_controller(make):
    """M = 5 instead of 4: feed-forward alone would be off by a quarter of the roll."""
    goal = np.deg2rad([5, 20])
    _, wrist, _ = run(make, 6.0, lambda t: goal, M=5)
    assert np.max(np.abs(np.rad2deg(wrist[-1] - goal))) < 0.1


@pytest.mark.parametrize("stuck", MEASURED)
def test_a_stuck_sensor_leaves_everything_bounded(make, stuck):
    """The sensor stands still from 0.2 s on, in full motion. The wrist ends within the bounds of the correction: 0.2 rad."""
    goal, held = np.deg2rad([30, 60]), {}

    def measure(t, values):
        if t >= 0.2:
            values[stuck] = held.setdefault(stuck, values[stuck])
        return values

    _, wrist, motors = run(make, 3.0, lambda t: goal, measure)
    assert np.all(np.isfinite(wrist)) and np.all(np.isfinite(motors))
    assert np.max(np.abs(wrist - goal)[-500:]) < 0.2 + 0.02
    assert np.max(np.abs(motors[-500:, 2:])) < 0.1
    assert np.max(np.abs(motors[:, 2:])) <= 3 + 1e-9


@pytest.mark.parametrize("steps", [[1e-3], [1 / 60], [0.7e-3, 0.1e-3, 1.9e-3], [1e-3 + 3e-13], [0.0125]])
def test_samples_keep_their_times_whatever_the_communication_step(controller, steps):
    """Free of feedback: motors at any time are those of a run with steps of the sample time."""
    start(controller, pitch_ref=0.5, roll_ref=-0.3, Kp=0.0, Ki=0.0, Kd=0.0, max_torque=1e3)
    names = ("theta1", "theta2", "omega1", "omega2")
    t, k, found = 0.0, 0, []
    while t < 0.6:
        h = steps[k % len(steps)]
        controller.step(t, h)
        t, k = t + h, k + 1
        found.append((t, *controller.get(*names)))
    found = np.array(found)
    controller.fmi.reset()
    start(controller, pitch_ref=0.5, roll_ref=-0.3, Kp=0.0, Ki=0.0, Kd=0.0, max_torque=1e3)
    samples = [controller.get(*names)]
    for k in range(700):
        controller.step(k * 1e-3, 1e-3)
        samples.append(controller.get(*names))
    samples = np.array(samples)
    # Between samples theta is a parabola with the rates at its ends.
    index = np.minimum((found[:, 0] / 1e-3).astype(int), 699)
    into = found[:, :1] - index[:, None] * 1e-3
    slope = (samples[index + 1, 2:] - samples[index, 2:]) / 1e-3
    theta = samples[index, :2] + samples[index, 2:] * into + slope * into**2 / 2
    np.testing.assert_allclose(found[:, 1:3], theta, atol=1e-12)
    # A point up to 1e-9 s behind a sample still counts as the sample's, and rates bend there by up to 60 rad/s2.
    np.testing.assert_allclose(found[:, 3:], samples[index, 2:] + slope * into, atol=1e-7)


def test_states_bring_everything_back(controller):
    """Saved, serialized into another instance's life, restored: the same bits."""
    start(controller, pitch_ref=0.4)
    rng = np.random.default_rng(7)

    def go(begin: int):
        generator, rows = np.random.default_rng(begin), []
        for k in range(begin, begin + 200):
            controller.set(**dict(zip(MEASURED, generator.normal(0, 0.1, 6))))
            if k % 3 == 0:
                controller.fmi.setRealInputDerivatives([controller.variables["pitch"].valueReference], [1], [1.0])
            controller.step(k * 0.7e-3, 0.7e-3)
            rows.append(controller.get(*MOTORS, "pitch_correction", "roll_correction"))
        return np.array(rows)

    go(0)
    controller.set(pitch=rng.normal())
    saved = controller.fmi.getFMUstate()
    data = controller.fmi.serializeFMUstate(saved)
    after = go(200)
    controller.fmi.setFMUstate(saved)
    np.testing.assert_array_equal(go(200), after)
    controller.fmi.freeFMUstate(saved)
    controller.fmi.reset()
    restored = controller.fmi.deSerializeFMUstate(data)
    controller.fmi.setFMUstate(restored)
    np.testing.assert_array_equal(go(200), after)
    controller.fmi.freeFMUstate(restored)


def test_no_output_feels_an_input_before_its_sample(controller):
    start(controller)
    references = [controller.variables[name].valueReference for name in (*MOTORS, "pitch_correction")]
    before = controller.get(*MOTORS)
    controller.set(pitch_ref=1.0, pitch=0.3, tau1=4.0)
    np.testing.assert_array_equal(controller.get(*MOTORS), before)
    known = [controller.variables[name].valueReference for name in ("pitch_ref", *MEASURED)]
    assert controller.fmi.getDirectionalDerivative(references, known, [1.0] * len(known)) == [0.0] * len(references)
    controller.step(0.0, STEP)
    assert controller.get("omega1")[0] > before[2]


def test_output_derivatives_are_those_of_the_motion(controller):
    start(controller, pitch_ref=0.5)
    controller.step(0.0, 2.5e-3)
    references = [controller.variables[name].valueReference for name in MOTORS]
    first = controller.fmi.getRealOutputDerivatives(references, [1] * 4)
    np.testing.assert_allclose(first, [*controller.get("omega1", "omega2"), 30.0, 30.0])
    # More than maxOutputDerivativeOrder, which is all that OMSimulator asks for: theta' must be it.
    with pytest.raises(FMICallException):
        controller.fmi.getRealOutputDerivatives(references[:2], [2, 2])


@pytest.mark.parametrize(
    "name, value, message",
    [
        ("sample_time", 0.0, "sample_time must not be below 0.000000001, it is 0"),
        ("Ki", 2000.0, "Ki * sample_time must not exceed 1"),
        ("max_rate", -3.0, "max_rate must not be below"),
        ("pitch", float("nan"), "pitch must be a finite number"),
    ],
)
def test_nonsense_is_refused_with_a_reason(controller, name, value, message):
    controller.fmi.setupExperiment(startTime=0.0)
    controller.fmi.enterInitializationMode()
    old = controller.get(name)[0]
    with pytest.raises(FMICallException):
        controller.set(**{name: value})
    assert controller.get(name)[0] == old
    assert message in controller.complaints()[-1][2]


def test_motors_start_where_they_stand(controller):
    start(controller, theta1=0.7, theta2=0.7, pitch_ref=0.7, pitch=0.7)
    for k in range(100):
        controller.step(k * STEP, STEP)
    np.testing.assert_array_equal(controller.get(*MOTORS), [0.7, 0.7, 0.0, 0.0])
