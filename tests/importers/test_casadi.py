"""CasADi's DaeBuilder on the unpacked FMU, in Model Exchange: values, Jacobians and integration are compared with the oracle."""

from __future__ import annotations

import numpy as np
import pytest
from built import needed
from lagrange import OUTPUTS, REAL, linear_model, table_1, varied
from reference import follow

needed("casadi", "casadi")

import casadi  # noqa: E402


@pytest.fixture(scope="module")
def model():
    return linear_model(table_1())


def right(model, x, u):
    """Returns x' (6,) and outputs (8,) at states x (6,) and inputs u (4,): angles and rates of the motors."""
    outputs = model.outputs(x, u[:2], u[2:])
    return model.a @ x + model.b_angle @ u[:2] + model.b_rate @ u[2:], np.array([outputs[name] for name in OUTPUTS])


def share(found, expected) -> float:
    """Returns the largest difference, relative to the largest expected value."""
    off = np.abs(np.array(found).reshape(np.shape(expected)) - expected).max()
    return float(off / (np.abs(expected).max() or 1.0))


def test_values_and_jacobians(testbed, unpack, model, stated):
    dae = casadi.DaeBuilder("testbed", unpack(testbed))
    assert dae.y() == list(OUTPUTS) and dae.u() == ["theta1", "theta2", "omega1", "omega2"]
    f = dae.create("f", ["x", "u"], ["ode", "y"])
    jacobians = f.factory(
        "j", ["x", "u"], [f"jac:{result}:{argument}" for result in ("ode", "y") for argument in ("x", "u")]
    )
    rng, worst = np.random.default_rng(3), 0.0
    # The model is linear in states and inputs, so differences of values are exact columns of the Jacobians.
    base = right(model, np.zeros(6), np.zeros(4))
    unit = np.eye(10)
    whole = [np.column_stack([right(model, e[:6], e[6:])[i] - base[i] for e in unit]) for i in (0, 1)]
    for _ in range(20):
        x, u = rng.normal(size=6), rng.normal(size=4)
        worst = max(worst, *(share(a, b) for a, b in zip(f(x, u), right(model, x, u))))
        found = [np.array(m) for m in jacobians(x, u)]
        worst = max(worst, share(np.hstack(found[:2]), whole[0]), share(np.hstack(found[2:]), whole[1]))
    assert worst < 1e-13
    stated("CasADi", "casadi", "values and Jacobians: 1e-13")


def test_cvodes(testbed, unpack, model, stated):
    """The testbed starts with twisted couplings, and the motors do not turn."""
    dae = casadi.DaeBuilder("testbed", unpack(testbed))
    x, u = casadi.MX.sym("x", 6), casadi.MX.sym("u", 4)
    equations = {"x": x, "u": u, "ode": dae.create("f", ["x", "u"], ["ode"])(x, u)}
    t = np.arange(21) * 0.1
    solver = casadi.integrator("s", "cvodes", equations, 0, t[1:], {"abstol": 1e-11, "reltol": 1e-10})
    held, start = np.array([0.2, -0.1]), np.array([0.5, -0.3, 0.1, 0.4, 3.0, -2.0])
    inputs = np.tile([*held, 0.0, 0.0], (20, 1)).T
    found = np.array(solver(x0=start, u=inputs)["xf"])
    at, _ = follow(model, t, np.tile(held, (21, 1)), np.zeros((21, 2)), x0=start)
    worst = max(share(found[row], at[name][1:]) for row, name in ((0, "theta3"), (1, "theta4")))
    assert worst < 1e-9
    stated("CasADi", "casadi", "`cvodes`: 1e-9")


def test_derivatives_with_respect_to_parameters(tunable, unpack, stated):
    """CasADi treats `fixed` parameters as constants. In the FMU built with `--tunable` parameters are tunable, and CasADi makes them the
    input `p` of its functions."""
    dae = casadi.DaeBuilder("testbed", unpack(tunable))
    physical = np.array([name in REAL for name in dae.p()])
    assert {name for name, real in zip(dae.p(), physical) if real} == set(REAL)
    assert all(name.endswith("_start") for name, real in zip(dae.p(), physical) if not real)
    f = dae.create("f", ["x", "u", "p"], ["ode", "y"])
    jacobian = f.factory("j", ["x", "u", "p"], ["jac:ode:p", "jac:y:p"])
    rng, worst = np.random.default_rng(4), 0.0
    for _ in range(5):
        x, u = rng.normal(size=6), rng.normal(size=4)
        # The start parameters have no effect, because the states are set.
        near = varied(rng.uniform(0.7, 1.3, len(REAL)))
        p = np.array([near.get(name, 1.0) for name in dae.p()])

        def at(values, x=x, u=u):
            return right(linear_model({**table_1(), **dict(zip(dae.p(), values))}), x, u)

        assert max(share(a, b) for a, b in zip(f(x, u, p), at(p))) < 1e-13
        for i, found in enumerate(jacobian(x, u, p)):
            columns = []
            for step in np.diag(1e-3 * p):
                # Richardson extrapolation of central differences: fourth order in the step.
                wide, narrow = ((at(p + k * step)[i] - at(p - k * step)[i]) / (2 * k * step.sum()) for k in (2, 1))
                columns.append((4 * narrow - wide) / 3)
            expected = np.column_stack(columns)
            found = np.array(found)
            # Differences have rounding errors even where a parameter has no effect. So an error is divided by the effect of its
            # parameter, but at least by a thousandth of the largest effect.
            effects = np.abs(expected * p).max(axis=0)
            sizes = np.maximum(effects, 1e-3 * effects.max())
            worst = max(worst, *(np.abs((found - expected) * p).max(axis=0) / sizes)[physical])
            assert not found[:, np.logical_not(physical)].any()
    assert worst < 1e-9
    stated("CasADi", "casadi", "derivatives with respect to parameters: 1e-9")
