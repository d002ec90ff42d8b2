"""Compares the testbed in Model Exchange with Co-Simulation, the oracle and FMPy. The Rust tests of fmu-run have models with events."""

from __future__ import annotations

import fmpy
import fmu_run
import numpy as np
import pytest
from lagrange import OUTPUTS, linear_model, table_1
from reference import follow, integrate

ANGLES = ("theta1", "theta2")
MOTORS = {"theta1": (0.3, 14.0), "theta2": (0.2, 23.0)}


@pytest.fixture
def wrist(testbed):
    with fmu_run.Fmu(testbed) as fmu:
        yield fmu


@pytest.fixture(scope="module")
def model():
    return linear_model(table_1())


def sines(time):
    """Returns angles, rates and accelerations of both motors, (times, 2) each."""
    a, w = np.array(list(MOTORS.values())).T
    phase = np.multiply.outer(time, w)
    return a * np.sin(phase), a * w * np.cos(phase), -a * w**2 * np.sin(phase)


def within(found, expected, tolerance):
    for name, signal in expected.items():
        scale = np.abs(signal).max()
        assert scale > 0 and np.abs(found[name][0] - signal).max() <= tolerance * scale, name


def test_motors_at_constant_rates_agree_with_co_simulation_and_the_oracle(wrist, model):
    """The rates are the slopes of the angles, and jump where the angles have a kink."""
    time = np.arange(301) * 2e-3
    corners = np.array([[0.0, 0.0], [0.2, -0.1], [0.2, 0.3], [-0.1, 0.1]])
    angles = np.stack([np.interp(time, [0.0, 0.2, 0.34, 0.6], corner) for corner in corners.T], axis=1)
    slopes = np.diff(angles, axis=0) / np.diff(time)[:, None]
    slopes = np.vstack([slopes, slopes[-1:]])
    expected, _ = follow(model, time, angles, slopes)
    inputs = dict(zip(ANGLES, angles.T))
    rates = {"omega1": "der(theta1)", "omega2": "der(theta2)"}
    exchanged = wrist.run(time, inputs=inputs | rates, outputs=OUTPUTS, interface="model_exchange", rtol=1e-9).check()
    within(exchanged, expected, 1e-8)
    given = dict(zip(("omega1", "omega2"), slopes.T))
    stepped = wrist.run(time, inputs=inputs | given, outputs=OUTPUTS, start={"use_omega": True}).check()
    within(exchanged, {name: stepped[name][0] for name in OUTPUTS}, 1e-8)
    # On a coarser grid, the corners of the angles are between samples.
    own = {name: ([0.0, 0.2, 0.34, 0.6], corner) for name, corner in zip(ANGLES, corners.T)}
    few = wrist.run(time[::7], inputs=own | rates, outputs=OUTPUTS, interface="model-exchange", rtol=1e-10).check()
    within(few, {name: signal[::7] for name, signal in expected.items()}, 1e-8)


def test_moving_motors_agree_with_the_oracle_where_fmpy_has_the_error_of_held_inputs(wrist, model, testbed):
    time = np.arange(501) * 1e-3
    angles, rates, accelerations = sines(time)
    names = (*ANGLES, "omega1", "omega2")
    values = dict(zip(names, np.hstack([angles, rates]).T))
    slopes = dict(zip(names, np.hstack([rates, accelerations]).T))
    expected = integrate(model, time, lambda t: sines(t)[0], lambda t: sines(t)[1], x0=[0] * 6)

    def run(**options):
        return wrist.run(time, outputs=OUTPUTS, interface="model_exchange", rtol=1e-9, **options).check()

    within(run(inputs=values, input_derivatives=slopes), expected, 1e-8)
    within(run(inputs=values), expected, 1e-3)
    types = [("time", np.float64), *[(name, np.float64) for name in names]]
    signals = np.array(list(zip(time, *values.values())), dtype=types)
    held = fmpy.simulate_fmu(
        str(testbed),
        fmi_type="ModelExchange",
        stop_time=time[-1],
        output_interval=1e-3,
        relative_tolerance=1e-6,
        input=signals,
        output=["tau1", "roll"],
    )
    for name, error in {"roll": 3e-3, "tau1": 2e-2}.items():
        assert np.abs(held[name] - expected[name]).max() > error * np.abs(expected[name]).max()


@pytest.mark.parametrize("solver", ["dopri5", "dop853", "bdf"])
def test_solvers_agree(wrist, solver):
    start = {"start_at_rest": False, "theta5_start": 0.3}
    time = [0.0, 0.1, 0.5]

    def run(**options):
        return wrist.run(time, outputs=["pitch"], start=start, interface="model_exchange", **options).check()["pitch"]

    np.testing.assert_allclose(run(solver=solver, rtol=1e-9), run(rtol=1e-11), rtol=0, atol=1e-7)


def test_batches_statistics_and_threads(wrist):
    time, stiffness = np.arange(101) * 2e-3, np.linspace(60.0, 240.0, 8)
    inputs = {"theta1": 0.2 * np.sin(9 * time), "omega1": "der(theta1)"}

    def run(**options):
        return wrist.run(time, inputs=inputs, outputs=["roll", "tau1"], interface="model_exchange", **options).check()

    batch = run(start={"k1": stiffness}, threads=2)
    assert batch["roll"].shape == (8, 101)
    for index, k1 in enumerate(stiffness):
        np.testing.assert_array_equal(run(start={"k1": k1})["tau1"][0], batch["tau1"][index])
    peaks = run(start={"k1": stiffness}, measures=["peak", "end"])
    np.testing.assert_array_equal(peaks["tau1", "peak"], np.abs(batch["tau1"]).max(axis=1))
    np.testing.assert_array_equal(run(start={"k1": stiffness}, every=10)["roll"], batch["roll"][:, ::10])


def test_outputs_before_and_after_an_event(wrist):
    runs = wrist.run(
        [0.0, 1.0],
        inputs={"theta1": ([0.0, 0.5, 0.5], [0.0, 0.0, 0.1])},
        outputs=["tau1"],
        interface="model_exchange",
        events=True,
    ).check()
    (event,) = runs.events
    assert (event.run, event.time) == (0, 0.5)
    assert event.before["tau1"] == 0 and event.after["tau1"] != 0
    assert wrist.run([0.0, 1.0], outputs=["tau1"]).events == []


def test_arguments(wrist, controller):
    def wrong(match, **arguments):
        with pytest.raises(ValueError, match=match):
            wrist.run([0.0, 1.0], outputs=["roll"], **arguments)

    wrong("interface must be 'co-simulation' or 'model-exchange', it is 'cs'", interface="cs")
    wrong(
        "there is no solver 'euler'|no solver \"euler\"; there are auto, dopri5",
        interface="model_exchange",
        solver="euler",
    )
    wrong("solver, rtol, atol and max_step are for Model Exchange", rtol=1e-6)
    wrong("rtol is 0; it must be above 0", interface="model_exchange", rtol=0.0)
    wrong("read_before_set is for Co-Simulation", interface="model_exchange", read_before_set=True)
    wrong('theta1 is "sin"; the value of a number is a number', inputs={"theta1": "sin"})
    wrong("derivatives of other inputs are for continuous inputs in Model Exchange", inputs={"omega1": "der(theta1)"})
    wrong(
        "omega1 is the derivative of theta1, which is not among the continuous inputs",
        interface="model_exchange",
        inputs={"omega1": "der(theta1)"},
    )
    with fmu_run.Fmu(controller) as law:
        loop = fmu_run.System({"law": law, "wrist": wrist}, {"law.theta1": "wrist.theta1"})
        with pytest.raises(
            fmu_run.FmuError, match="systems run in Co-Simulation only, and a single FMU also in Model Exchange"
        ):
            loop.run([0.0, 1.0], outputs=["wrist.roll"], interface="model_exchange")
