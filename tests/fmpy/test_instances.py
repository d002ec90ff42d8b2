"""Instances: reset, reuse, many at once, parameters, and FMPy's ways of feeding them."""

from __future__ import annotations

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from lagrange import OUTPUTS, linear_model, table_1
from reference import follow
from slave import assert_close


def path(seed: int, points: int = 60):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(0.001, 0.02, points)), np.cumsum(rng.normal(0, 0.02, (points, 2)), axis=0)


def assert_same(one, other):
    for a, b in zip(one, other):
        for name in OUTPUTS:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_reset_and_reuse_are_bit_identical(slave):
    t, theta = path(1)
    runs = []
    for _ in range(3):
        slave.start(theta[0], time=t[0])
        runs.append(slave.run(t, theta))
        slave.fmi.terminate()
        slave.fmi.reset()
    assert_same(runs[0], runs[1])
    assert_same(runs[0], runs[2])


def test_reset_restores_the_start_values(slave):
    t, theta = path(2)
    slave.start(theta[0], rate=(0.0, 0.0), time=t[0], k1=77.0)
    slave.run(t, theta)
    slave.fmi.reset()
    slave.fmi.setupExperiment()
    slave.fmi.enterInitializationMode()
    for name, variable in slave.variables.items():
        if variable.type == "Real" and variable.start is not None:
            assert slave.get(name)[0] == float(variable.start), name
    assert slave.fmi.getInteger([slave.variables["N"].valueReference]) == [7]
    assert not any(slave.fmi.getBoolean([slave.variables["use_omega"].valueReference]))


def test_a_fresh_instance_repeats_the_run(make_slave):
    t, theta = path(3)
    runs = []
    for name in ("first", "second"):
        slave = make_slave(name)
        slave.start(theta[0], time=t[0])
        runs.append(slave.run(t, theta))
    assert_same(*runs)


def test_ten_interleaved_instances_do_not_meet(make_slave):
    t, _ = path(4)
    motors = [path(10 + i)[1] for i in range(10)]
    stiffness = [50.0 + 20 * i for i in range(10)]

    def start(i):
        slave = make_slave(f"instance {i}")
        slave.start(motors[i][0], time=t[0], k1=stiffness[i])
        return slave

    alone = [start(i).run(t, motors[i])[1] for i in range(10)]
    together = [start(i) for i in range(10)]
    after = [[] for _ in together]
    for k in range(len(t) - 1):
        for i, slave in enumerate(together):
            slave.set(theta1=motors[i][k, 0], theta2=motors[i][k, 1])
            slave.step(t[k], t[k + 1] - t[k])
            after[i].append(slave.get(*OUTPUTS))
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
def test_each_parameter_counts(slave, model, change):
    t, theta = path(5)
    slope = np.vstack([np.diff(theta, axis=0) / np.diff(t)[:, None], [[0.0, 0.0]]])
    changed = linear_model({**table_1(), **change})
    slave.start(theta[0], time=t[0], **change)
    after = slave.run(t, theta, derivative=slope)[1]
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
def test_bad_values_are_refused_by_name(slave, name, value):
    slave.fmi.setupExperiment()
    slave.fmi.enterInitializationMode()
    before = {n: slave.get(n)[0] for n, v in slave.variables.items() if v.type == "Real" and v.start is not None}
    with pytest.raises(FMICallException):
        slave.set(**{name: value})
    assert any(status == 3 and name in text for status, _, text in slave.messages)
    assert before == {n: slave.get(n)[0] for n in before}


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


def test_state_can_be_kept_and_replayed(slave):
    t, theta = path(7)
    slave.start(theta[0], time=t[0])
    half = len(t) // 2
    slave.run(t[: half + 1], theta)
    kept = slave.fmi.getFMUstate()
    bytes_kept = slave.fmi.serializeFMUstate(kept)
    first = slave.run(t[half:], theta[half:])
    slave.fmi.setFMUstate(kept)
    second = slave.run(t[half:], theta[half:])
    restored = slave.fmi.deSerializeFMUstate(bytes_kept)
    slave.fmi.setFMUstate(restored)
    third = slave.run(t[half:], theta[half:])
    slave.fmi.freeFMUstate(kept)
    slave.fmi.freeFMUstate(restored)
    assert_same(first, second)
    assert_same(first, third)


def test_directional_derivatives_are_the_matrices(slave, model):
    states, inputs = (
        ("theta3", "theta4", "theta5", "theta6", "omega5", "omega6"),
        ("theta1", "theta2", "omega1", "omega2"),
    )
    expected = np.block([[model.a, model.b_angle, model.b_rate], [model.c, model.d_angle, model.d_rate]])
    slave.start()
    references = {name: v.valueReference for name, v in slave.variables.items()}
    unknowns = [references[f"der({name})"] for name in states] + [references["tau1"], references["tau2"]]
    for column, name in enumerate((*states, *inputs)):
        found = slave.fmi.getDirectionalDerivative(unknowns, [references[name]], [2.0])
        np.testing.assert_allclose(found, 2 * expected[:, column], rtol=1e-11, atol=1e-10, err_msg=name)
