"""Instances: reset, reuse, many at once, parameters, and FMPy's ways of feeding them."""

from __future__ import annotations

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from instance import assert_close
from lagrange import OUTPUTS, linear_model, table_1
from reference import follow


def path(seed: int, points: int = 60):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(0.001, 0.02, points)), np.cumsum(rng.normal(0, 0.02, (points, 2)), axis=0)


def assert_same(one, other):
    for a, b in zip(one, other):
        for name in OUTPUTS:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_reset_and_reuse_are_bit_identical(instance):
    t, theta = path(1)
    runs = []
    for _ in range(3):
        instance.start(theta[0], time=t[0])
        runs.append(instance.run(t, theta))
        instance.fmi.terminate()
        instance.fmi.reset()
    assert_same(runs[0], runs[1])
    assert_same(runs[0], runs[2])


def test_reset_restores_the_start_values(instance):
    t, theta = path(2)
    instance.start(theta[0], rate=(0.0, 0.0), time=t[0], k1=77.0)
    instance.run(t, theta)
    instance.fmi.reset()
    instance.fmi.setupExperiment()
    instance.fmi.enterInitializationMode()
    for name, variable in instance.variables.items():
        if variable.type == "Real" and variable.start is not None:
            assert instance.get(name)[0] == float(variable.start), name
    assert instance.fmi.getInteger([instance.variables["N"].valueReference]) == [7]
    assert not any(instance.fmi.getBoolean([instance.variables["use_omega"].valueReference]))


def test_a_fresh_instance_repeats_the_run(make_instance):
    t, theta = path(3)
    runs = []
    for name in ("first", "second"):
        instance = make_instance(name)
        instance.start(theta[0], time=t[0])
        runs.append(instance.run(t, theta))
    assert_same(*runs)


def test_ten_interleaved_instances_do_not_meet(make_instance):
    t, _ = path(4)
    motors = [path(10 + i)[1] for i in range(10)]
    stiffness = [50.0 + 20 * i for i in range(10)]

    def start(i):
        instance = make_instance(f"instance {i}")
        instance.start(motors[i][0], time=t[0], k1=stiffness[i])
        return instance

    alone = [start(i).run(t, motors[i])[1] for i in range(10)]
    together = [start(i) for i in range(10)]
    after = [[] for _ in together]
    for k in range(len(t) - 1):
        for i, instance in enumerate(together):
            instance.set(theta1=motors[i][k, 0], theta2=motors[i][k, 1])
            instance.step(t[k], t[k + 1] - t[k])
            after[i].append(instance.get(*OUTPUTS))
    for i in range(10):
        np.testing.assert_array_equal(np.array(after[i]), np.array([alone[i][name] for name in OUTPUTS]).T)


@pytest.mark.parametrize(
    "change",
    [
        {"J2": 0.01},
        {"J3": 0.05},
        {"H3": 0.1},
        {"k1": 60.0},
        {"k2": 80.0},
        {"c1": 1.0},
        {"c2": 0.1},
        {"c3": 2.0},
        {"M": 6},
        {"N": 11},
    ],
)
def test_each_parameter_counts(instance, model, change):
    t, theta = path(5)
    slope = np.vstack([np.diff(theta, axis=0) / np.diff(t)[:, None], [[0.0, 0.0]]])
    changed = linear_model({**table_1(), **change})
    instance.start(theta[0], time=t[0], **change)
    after = instance.run(t, theta, derivative=slope)[1]
    assert_close(after, follow(changed, t, theta, slope)[1], 1e-11)
    with pytest.raises(AssertionError):
        assert_close(after, follow(model, t, theta, slope)[1], 1e-4)


@pytest.mark.parametrize(
    "name, value",
    [
        ("J2", 0.0),
        ("J3", -1.0),
        ("H3", 0.0),
        ("k1", 0.0),
        ("k2", -5.0),
        ("c1", -1e-9),
        ("c3", -1.0),
        ("M", 0),
        ("N", -7),
        ("k1", float("nan")),
        ("theta1", float("inf")),
        ("theta3_start", float("nan")),
    ],
)
def test_bad_values_are_refused_by_name(instance, name, value):
    instance.fmi.setupExperiment()
    instance.fmi.enterInitializationMode()
    before = {n: instance.get(n)[0] for n, v in instance.variables.items() if v.type == "Real" and v.start is not None}
    with pytest.raises(FMICallException):
        instance.set(**{name: value})
    assert any(status == 3 and name in text for status, _, text in instance.messages)
    assert before == {n: instance.get(n)[0] for n in before}


def test_set_input_derivatives_of_simulate_fmu(fmu, model):
    """FMPy hands over the slope of its input table at each communication point."""
    from fmpy.simulation import Input

    rng = np.random.default_rng(6)
    grid = np.arange(0, 21) * 0.05
    theta = np.cumsum(rng.normal(0, 0.1, (21, 2)), axis=0)
    table = np.asarray(np.rec.fromarrays([grid, *theta.T], names="time,theta1,theta2"))
    try:
        result = fmpy.simulate_fmu(
            str(fmu),
            stop_time=1.0,
            output_interval=0.01,
            input=table,
            output=list(OUTPUTS),
            set_input_derivatives=True,
            fmi_type="CoSimulation",
        )
    except ValueError as error:
        pytest.skip(f"FMPy {fmpy.__version__} cannot set input derivatives: {error}")
    # The points FMPy stepped through and what its interpolation gives there.
    t = result["time"]
    at_points = [Input.interpolate(s, grid, theta.T) for s in t]
    values, slopes = (np.array([np.ravel(p[i]) for p in at_points]) for i in (0, 1))
    _, after = follow(model, t, values, slopes)
    assert_close({name: result[name][1:] for name in OUTPUTS}, after, 1e-11)
    assert np.ptp(after["roll"]) > 0.1


def test_state_can_be_kept_and_replayed(instance):
    t, theta = path(7)
    instance.start(theta[0], time=t[0])
    half = len(t) // 2
    instance.run(t[: half + 1], theta)
    kept = instance.fmi.getFMUstate()
    bytes_kept = instance.fmi.serializeFMUstate(kept)
    first = instance.run(t[half:], theta[half:])
    instance.fmi.setFMUstate(kept)
    second = instance.run(t[half:], theta[half:])
    restored = instance.fmi.deSerializeFMUstate(bytes_kept)
    instance.fmi.setFMUstate(restored)
    third = instance.run(t[half:], theta[half:])
    instance.fmi.freeFMUstate(kept)
    instance.fmi.freeFMUstate(restored)
    assert_same(first, second)
    assert_same(first, third)
