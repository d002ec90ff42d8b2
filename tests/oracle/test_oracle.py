"""Compares the oracle with known numbers and physical laws, and its two methods with each other."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from lagrange import OUTPUTS, dissipation, hessian, kinetic_energy, linear_model, potential_energy, table_1
from reference import at_rest, augmented, backward_slope, exponential, follow, integrate

MODEL = linear_model(table_1())


def test_eigenvalues():
    expected = [
        -174.87270665,
        -174.36733032,
        -18.94465405 + 32.14568305j,
        -18.94465405 - 32.14568305j,
        -9.68285129 + 34.67786598j,
        -9.68285129 - 34.67786598j,
    ]
    found = np.linalg.eigvals(MODEL.a)
    for value in expected:
        assert np.min(np.abs(found - value)) < 1e-8


def test_dc_gain_and_equilibrium():
    gain = np.linalg.solve(-MODEL.a, MODEL.b_angle)
    np.testing.assert_allclose(gain[:4], [[1, 0], [0, 1], [1, 0], [0, 1]], atol=1e-12)
    np.testing.assert_allclose(gain[4:], 0, atol=1e-10)
    np.testing.assert_allclose(MODEL.c @ gain + MODEL.d_angle, 0, atol=1e-12)


def test_pitch_and_roll_subsystems():
    """The sum and the difference of the two sides are independent: (theta5 +- theta6)/2 have inertias of 2 J2 + H3 and
    2 J2 + J3 N^2/M^2."""
    p = table_1()
    m = hessian(kinetic_energy, p)[4:, 4:]
    np.testing.assert_allclose([m[0, 0] + m[0, 1]], p["J2"] + p["H3"] / 2, rtol=1e-14)
    np.testing.assert_allclose([m[0, 0] - m[0, 1]], p["J2"] + p["J3"] * 49 / 32, rtol=1e-14)
    for sign in (1, -1):
        assert np.allclose(
            MODEL.a[[0, 2, 4]] @ np.kron(np.eye(3), [[1], [sign]]),
            sign * MODEL.a[[1, 3, 5]] @ np.kron(np.eye(3), [[1], [sign]]),
            atol=1e-9,
        )


def test_torque_is_equation_9():
    p = table_1()
    rng = np.random.default_rng(9)
    x, theta, rate = rng.normal(size=6), rng.normal(size=2), rng.normal(size=2)
    shaft_rate = (MODEL.a @ x + MODEL.b_angle @ theta + MODEL.b_rate @ rate)[:2]
    expected = p["k1"] * (x[:2] - theta) + p["c1"] * (shaft_rate - rate)
    out = MODEL.outputs(x, theta, rate)
    np.testing.assert_allclose([out["tau1"], out["tau2"]], expected, rtol=1e-12)


def test_energy_balance():
    """The power of the motors equals the rate of change of T + V plus twice the Rayleigh function."""
    p = table_1()
    x, theta, rate = np.array([0.3, -0.2, 0.1, 0.5, -1.0, 2.0]), np.array([0.4, 0.1]), np.array([1.5, -0.5])
    dx = MODEL.a @ x + MODEL.b_angle @ theta + MODEL.b_rate @ rate
    q, w = np.array([*theta, *x[:4]]), np.array([*rate, *dx[:4]])
    w_dot = np.array([0, 0, 0, 0, dx[4], dx[5]])
    stored = hessian(kinetic_energy, p) @ w @ w_dot + hessian(potential_energy, p) @ q @ w
    out = MODEL.outputs(x, theta, rate)
    power_in = -(out["tau1"] * rate[0] + out["tau2"] * rate[1])
    assert power_in == pytest.approx(stored + 2 * dissipation(w, p), rel=1e-12)


def test_jump_is_the_limit_of_a_steep_ramp():
    jump, h = np.array([0.02, -0.01]), 1e-7
    z = exponential(augmented(MODEL) * h) @ np.concatenate([np.zeros(6), [0, 0], jump / h])
    np.testing.assert_allclose(z[:6], MODEL.impulse(jump), atol=2e-6)
    np.testing.assert_allclose(MODEL.impulse(jump), MODEL.b_rate @ jump, rtol=1e-12, atol=1e-15)


def test_exact_and_integrated_agree():
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.002, 0.05, 20))
    theta = np.cumsum(rng.normal(0, 0.05, (20, 2)), axis=0)
    slope = np.vstack([np.diff(theta, axis=0) / np.diff(t)[:, None], [[0, 0]]])
    _, after = follow(MODEL, t, theta, slope)

    def piece(s):
        return min(max(np.searchsorted(t, s, side="left") - 1, 0), len(t) - 2)

    solved = integrate(
        MODEL, t, lambda s: theta[piece(s)] + slope[piece(s)] * (s - t[piece(s)]), lambda s: slope[piece(s)], breaks=t
    )
    for name in OUTPUTS:
        scale = np.max(np.abs(after[name]))
        np.testing.assert_allclose(solved[name][1:], after[name], atol=1e-9 * scale, err_msg=name)


def test_doubles_agree_with_many_digits():
    rng = np.random.default_rng(2)
    t, theta = np.array([0, 0.01, 0.5, 0.501, 3.0]), rng.normal(size=(5, 2))
    slope = rng.normal(size=(5, 2))
    with mpmath.workdps(40):
        exact = linear_model(table_1(mpmath.mpf, mpmath.pi))
        as_mp = np.vectorize(mpmath.mpf, otypes=[object])
        _, many = follow(exact, as_mp(t), as_mp(theta), as_mp(slope))
    _, doubles = follow(MODEL, t, theta, slope)
    for name in OUTPUTS:
        np.testing.assert_allclose(doubles[name], many[name].astype(float), rtol=1e-11, atol=1e-13, err_msg=name)


def test_rest_stays_at_rest():
    theta = np.full((3, 2), np.deg2rad(40.0))
    at, after = follow(MODEL, np.array([0, 0.1, 5.0]), theta, 0 * theta)
    for values in (at, after):
        for name, expected in {"tau1": 0, "roll_rate": 0, "pitch": theta[0, 0], "theta3": theta[0, 0]}.items():
            np.testing.assert_allclose(
                values[name], expected, atol=1e-10
            )  # The torque k1 theta of one spring is 84 N.m.


def test_backward_slope_of_a_parabola_is_exact():
    t = np.array([0, 0.1, 0.15, 0.4, 0.41])
    theta = np.column_stack([1 + 2 * t - 3 * t**2, t])
    np.testing.assert_allclose(backward_slope(t, theta)[2:], np.column_stack([2 - 6 * t, 1 + 0 * t])[2:], rtol=1e-10)
    np.testing.assert_allclose(at_rest(theta[0]), [1, 0, 1, 0, 0, 0])
