"""If the motor angles are linear over each step, results are exact within 1e-11 of the largest value, also for extreme parameters
and uneven steps. If the angles are sines, the error of every output is of second order in the step size."""

from __future__ import annotations

import re
from functools import partial

import mpmath
import numpy as np
import pytest
from built import ROOT
from fmpy import simulate_fmu
from instance import assert_close
from lagrange import OUTPUTS, REAL, linear_model, table_1, varied
from reference import backward_slope, follow, integrate


def random_case(seed: int, points: int, decades: float):
    """Returns parameters, uneven times, and continuous piecewise linear angles with their slopes. The Real parameters are within
    `decades` powers of ten of Table 1; M and N are from 1 to 11."""
    rng = np.random.default_rng(seed)
    parameters = varied([10 ** rng.uniform(-decades, decades) for _ in REAL])
    parameters.update(M=int(rng.integers(1, 12)), N=int(rng.integers(1, 12)))
    t = rng.uniform(-5, 5) + np.cumsum(10 ** rng.uniform(-4.5, -0.5, points))
    theta = rng.uniform(-1, 1, 2) + np.cumsum(rng.normal(0, 0.1, (points, 2)), axis=0)
    slope = np.vstack([np.diff(theta, axis=0) / np.diff(t)[:, None], [[0.0, 0.0]]])
    return parameters, t, theta, slope


def exact(parameters, t, theta, slope):
    """Returns the results of the oracle, calculated with 40 digits and rounded to doubles."""
    with mpmath.workdps(40):
        many = np.vectorize(mpmath.mpf, otypes=[object])
        model = linear_model({name: mpmath.mpf(value) for name, value in parameters.items()})
        at, after = follow(model, many(t), many(theta), many(slope))
        return tuple({name: v.astype(float) for name, v in values.items()} for values in (at, after))


def check(instance, parameters, t, theta, slope, expected):
    instance.start(theta[0], time=t[0], **parameters)
    found = instance.run(t, theta, derivative=slope)
    for values, true_values in zip(found, expected):
        assert_close(values, true_values, 1e-11)
    assert not instance.unexpected_messages()


@pytest.mark.parametrize("seed", range(12))
def test_random_parameters_paths_and_steps(instance, seed):
    # For parameters that are further from Table 1, the oracle loses digits in double precision, so test_extremes.py uses more digits.
    parameters, t, theta, slope = random_case(seed, points=200, decades=0.3)
    model = linear_model({name: float(value) for name, value in parameters.items()})
    check(instance, parameters, t, theta, slope, follow(model, t, theta, slope))


@pytest.mark.parametrize(
    "change",
    [
        {"c3": 0.0},
        {"c1": 0.0},
        {"c2": 0.0},
        {"c1": 0.0, "c3": 0.0},
        {"J2": 1e-7},
        {"k1": 1e5, "k2": 1e5},
        {"c1": 1e3, "c2": 1e3},
        {"c1": 1e-6, "c2": 1e-6, "c3": 0.0},
        {"k2": 1e-3},
        {"M": 1, "N": 50},
    ],
)
def test_hard_parameters(instance, change):
    _, t, theta, slope = random_case(7, points=10, decades=0)
    case = {**table_1(), **change}
    case.update(M=int(case["M"]), N=int(case["N"]))
    check(instance, case, t, theta, slope, exact(case, t, theta, slope))


def test_rates_from_omega(instance, model):
    """With use_omega, the motors turn at the given rates, regardless of the next angles."""
    rng = np.random.default_rng(6)
    t = np.cumsum(10 ** rng.uniform(-3, -1, 100))
    theta, omega = rng.normal(0, 0.1, (100, 2)), rng.normal(0, 1, (100, 2))
    instance.start(theta[0], rate=omega[0], time=t[0])
    for values, true_values in zip(instance.run(t, theta, rate=omega), follow(model, t, theta, omega)):
        assert_close(values, true_values, 1e-11)


def test_rates_from_angles(instance, model):
    """By default the rate is the slope of the parabola through the last three samples, also if they are not evenly spaced."""
    rng = np.random.default_rng(4)
    t = np.cumsum(rng.uniform(0.002, 0.02, 100))
    theta = np.cumsum(rng.normal(0, 0.02, (100, 2)), axis=0)
    instance.start(theta[0], time=t[0])
    at, after = instance.run(t, theta)
    expected_at, expected_after = follow(model, t, theta, backward_slope(t, theta))
    assert_close(at, expected_at, 1e-11)
    # Right after a step, torques use the rate that the parabola predicts, so the tests of second order below check them instead.
    assert_close({**after, "tau1": expected_after["tau1"], "tau2": expected_after["tau2"]}, expected_after, 1e-11)


def test_omega_has_no_effect_without_use_omega(make_instance):
    rng = np.random.default_rng(8)
    t, theta = 0.01 * np.arange(50), rng.normal(0, 0.1, (50, 2))
    plain, disturbed = make_instance(), make_instance()
    plain.start(theta[0])
    disturbed.start(theta[0])
    at, after = plain.run(t, theta)
    at_disturbed, after_disturbed = disturbed.run(t, theta, rate=rng.normal(0, 5, (50, 2)))
    for name in OUTPUTS:
        np.testing.assert_array_equal(at[name], at_disturbed[name])
        np.testing.assert_array_equal(after[name], after_disturbed[name])


def test_cvode_meets_its_tolerance(fmu, model):
    """Starts with twisted couplings in Model Exchange, with motors at rest. Errors add up to less than a hundred times the tolerance."""
    states, held = [0.5, -0.3, 0.1, 0.4, 3.0, -2.0], np.array([0.2, -0.1])
    start = dict(zip(("theta3", "theta4", "theta5", "theta6", "omega5", "omega6"), states))
    start = {f"{name}_start": value for name, value in start.items()}
    start |= {"start_at_rest": False, "theta1": held[0], "theta2": held[1]}
    options = {"fmi_type": "ModelExchange", "solver": "CVode", "relative_tolerance": 1e-9}
    found = simulate_fmu(
        str(fmu), stop_time=0.5, output_interval=1e-3, start_values=start, output=list(OUTPUTS), **options
    )
    true = integrate(model, found["time"], lambda _: held, lambda _: np.zeros(2), x0=np.array(states))
    assert_close(found, true, 1e-7)


AMPLITUDE, FREQUENCY, PHASE = np.array([0.3, 0.2]), np.array([14.0, 23.0]), np.array([0.4, 1.9])
END = 1.0
#: Repeated step sizes, in units of their mean.
SPACING = {"even": [1.0, 1.0, 1.0, 1.0], "uneven": [0.4, 1.5, 0.8, 1.3]}
#: Errors are evaluated from this time on. They are larger before it, because the first two samples do not define a parabola.
FROM = 0.3


def angle(t, phase=PHASE):
    return AMPLITUDE * np.sin(FREQUENCY * t + phase)


def rate(t, phase=PHASE):
    return AMPLITUDE * FREQUENCY * np.cos(FREQUENCY * t + phase)


def order_error(make_instance, model, spacing, steps, reading, phase=PHASE, since=FROM):
    t = np.concatenate([[0], np.cumsum(np.tile(spacing, steps // 4))]) * END / steps
    theta = np.array([angle(s, phase) for s in t])
    instance = make_instance()
    instance.start(theta[0])
    at, after = instance.run(t, theta)
    found = {"at": at, "after": {name: np.concatenate([[0], after[name]]) for name in OUTPUTS}}[reading]
    true = integrate(model, t, lambda s: angle(s, phase), lambda s: rate(s, phase))
    late = t >= since - 1e-9
    return {name: np.max(np.abs(found[name] - true[name])[late]) for name in OUTPUTS}


@pytest.mark.parametrize("spacing", SPACING)
@pytest.mark.parametrize("reading", ["at", "after"])
def test_second_order_with_angles_only(make_instance, model, spacing, reading):
    """Outputs are read after the new angles are set ("at"), and right after the step, as most importers do ("after")."""
    errors = [order_error(make_instance, model, SPACING[spacing], steps, reading) for steps in (200, 400, 800)]
    orders = {
        name: [float(np.log2(coarse[name] / fine[name])) for coarse, fine in zip(errors, errors[1:])]
        for name in OUTPUTS
    }
    assert all(min(found) >= 1.9 for found in orders.values()), orders


@pytest.mark.parametrize("spacing", SPACING)
def test_second_order_with_true_rates(make_instance, model, spacing):
    def with_rates(steps):
        t = np.concatenate([[0], np.cumsum(np.tile(SPACING[spacing], steps // 4))]) * END / steps
        theta, omega = np.array([angle(s) for s in t]), np.array([rate(s) for s in t])
        instance = make_instance()
        instance.start(theta[0], rate=omega[0])
        at, _ = instance.run(t, theta, rate=omega)
        true = integrate(model, t, angle, rate)
        return {name: np.max(np.abs(at[name] - true[name])) for name in OUTPUTS}

    coarse, fine = with_rates(200), with_rates(400)
    orders = {name: float(np.log2(coarse[name] / fine[name])) for name in OUTPUTS}
    assert min(orders.values()) >= 1.9, orders


def test_sines_in_steps_of_1_ms_are_as_accurate_as_the_readme_says(make_instance, model):
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    (percent,) = re.findall(
        r"every 1 ms, pitch and roll are within (\S+) % and torques within (\S+) % of their peaks after the third sample\."
        r" If the motors already turn at the first sample, this holds after (\S+) s",
        text,
    )
    *percent, settled = map(float, percent)
    # At the phase of 90 degrees the motors start at rest.
    starts = [(np.pi / 2, 3e-3), *((phase, settled) for phase in np.linspace(0, np.pi / 2, 4)[:-1])]
    largest = {}
    for phase, since in starts:
        motion = [partial(one, phase=phase) for one in (angle, rate)]
        true = integrate(model, np.linspace(0, END, 1001), *motion)
        for reading in ("at", "after"):
            errors = order_error(make_instance, model, SPACING["even"], round(END / 1e-3), reading, phase, since)
            for stated, names in zip(percent, [("pitch", "roll"), ("tau1", "tau2")]):
                found = max(100 * errors[name] / np.max(np.abs(true[name])) for name in names)
                assert found <= stated, (phase, reading, names)
                largest[names] = max(found, largest.get(names, 0))
    # A stated number is at most twice the error, because it should not hide an improvement.
    assert all(found > stated / 2 for stated, found in zip(percent, largest.values()))
