"""What Sec. 4 says of Figs. 4 and 5, of the FMU: of its linear model and of stepped sines measured on it."""

from __future__ import annotations

import numpy as np
import pytest
from lagrange import dissipation, hessian, kinetic_energy, potential_energy, table_1

import prw.testbed
from prw.linearization import linearize
from prw.motion import fig4
from prw.testbed import ANGLE_OF
from tools.frequency import SHAFTS, TORQUES, decibels, slope, sweep

#: Fig. 5: letter, row and column of H(s).
FIG5 = {letter: (k % 4, k // 4) for k, letter in enumerate("abcdefgh")}
MIRRORED = ("af", "be", "ch", "dg")
LOW, HIGH = np.geomspace(1e-4, 1e-2, 9), np.geomspace(1e5, 1e7, 9)
P = table_1()


@pytest.fixture(scope="module")
def linear(fmu):
    return linearize(fmu=fmu, outputs=(*SHAFTS, *TORQUES))


def h_of_eq_15(frequency):
    """H(s) with M, Delta and K from the energies, (k, 4, 2)."""
    m, delta, k = (hessian(form, P)[2:, 2:] for form in (kinetic_energy, dissipation, potential_energy))
    s = 2j * np.pi * np.asarray(frequency)[:, None, None]
    return np.linalg.solve(s**2 * m + s * delta + k, np.eye(4)[:, :2] * (P["c1"] * s + P["k1"]))


def torques_of_eq_9(frequency):
    """Torques for motor angles, (k, 2, 2): (k1 + c1 s) (q_I - theta)."""
    s = 2j * np.pi * np.asarray(frequency)[:, None, None]
    return (P["k1"] + P["c1"] * s) * (h_of_eq_15(frequency)[:, :2] - np.eye(2))


def test_h_of_the_linear_model_is_eq_15(linear):
    frequency = np.geomspace(0.01, 1000, 41)
    found = linear.response_at_hz(frequency, ANGLE_OF)
    np.testing.assert_allclose(found[:, :4], h_of_eq_15(frequency), rtol=1e-8)
    np.testing.assert_allclose(found[:, 4:], torques_of_eq_9(frequency), rtol=1e-8)


def test_swept_sines_lie_on_the_curves(fmu):
    """Below 50 Hz within 0.1 dB and 1 degree, as promised; the method is much better than that."""
    frequency = np.array([0.1, 0.37, 1.1, 2.9, 4.6, 5.3, 6.1, 9.0, 17.0, 31.0, 49.9])
    measured = sweep(fmu, frequency, slowest=9.68).response
    ratio = measured / np.concatenate([h_of_eq_15(frequency), torques_of_eq_9(frequency)], axis=1)
    assert np.abs(decibels(ratio)).max() < 0.01
    assert np.abs(np.rad2deg(np.angle(ratio))).max() < 0.1


def test_swept_sines_above(fmu):
    frequency = np.array([80.0, 200.0])
    ratio = sweep(fmu, frequency, slowest=9.68, outputs=SHAFTS).response / h_of_eq_15(frequency)
    assert np.abs(decibels(ratio)).max() < 0.01 and np.abs(np.rad2deg(np.angle(ratio))).max() < 0.1


@pytest.mark.parametrize("pair", MIRRORED)
def test_symmetry(linear, pair):
    found = linear.response_at_hz(np.geomspace(0.1, 1000, 50), ANGLE_OF)
    (row, column), (mirrored_row, mirrored_column) = (FIG5[letter] for letter in pair)
    np.testing.assert_allclose(found[:, row, column], found[:, mirrored_row, mirrored_column], rtol=1e-9)


@pytest.mark.parametrize("letter", "bdeg")
def test_rise_then_net_fall(linear, letter):
    """A high pass: +20 dB per decade; past the poles 40 less."""
    row, column = FIG5[letter]
    low, high = (linear.response_at_hz(f, ANGLE_OF)[:, row, column] for f in (LOW, HIGH))
    np.testing.assert_allclose(slope(LOW, low), 20, atol=0.01)
    np.testing.assert_allclose(slope(HIGH, high), -20, atol=0.01)
    assert decibels(low).max() < -50


@pytest.mark.parametrize("letter", "ch")
def test_net_fall(linear, letter):
    row, column = FIG5[letter]
    low, high = (linear.response_at_hz(f, ANGLE_OF)[:, row, column] for f in (LOW, HIGH))
    np.testing.assert_allclose(low, 1, atol=1e-3)
    np.testing.assert_allclose(slope(HIGH, high), -20, atol=0.01)
    # Before the zero of the second damper at 91 1/s the fall is steeper, towards the 40 of two poles.
    middle = np.geomspace(6, 9, 9)
    assert slope(middle, linear.response_at_hz(middle, ANGLE_OF)[:, row, column]).min() < -38
    # The asymptote: force c1 c2 / (c1 + c2) s theta1 on the carriers' inertia.
    c = P["c1"] * P["c2"] / (P["c1"] + P["c2"])
    inverse = np.linalg.inv(hessian(kinetic_energy, P)[4:, 4:])
    np.testing.assert_allclose(np.abs(high), c * inverse[0, 0] / (2 * np.pi * HIGH), rtol=1e-4)


@pytest.mark.parametrize("letter", "af")
def test_dampers_divide(linear, letter):
    row, column = FIG5[letter]
    low, high = (linear.response_at_hz(f, ANGLE_OF)[:, row, column] for f in (LOW, HIGH))
    np.testing.assert_allclose(low, 1, atol=1e-3)
    np.testing.assert_allclose(high, P["c1"] / (P["c1"] + P["c2"]), rtol=1e-3)


def test_torques_at_both_ends(linear):
    """Low: a rate against the load's damping alone. High: against the two dampers of a side in series."""
    low, high = (linear.response_at_hz(f, ANGLE_OF)[:, 4:] for f in (LOW, HIGH))
    load = hessian(dissipation, {**P, "c1": 0.0, "c2": 0.0})[4:, 4:]
    np.testing.assert_allclose(low / (2j * np.pi * LOW)[:, None, None], np.broadcast_to(-load, low.shape), rtol=1e-2)
    series = P["c1"] * P["c2"] / (P["c1"] + P["c2"])
    np.testing.assert_allclose(np.abs(high[:, 0, 0]), series * 2 * np.pi * HIGH, rtol=1e-3)


@pytest.mark.parametrize("opposite, still, moving", [(True, "pitch", "roll"), (False, "roll", "pitch")])
def test_fig4_and_its_counterpart(fmu, opposite, still, moving):
    """Opposite motors leave the pitch rate zero, equal ones the roll rate."""
    with prw.testbed.Testbed(fmu) as testbed:
        response = testbed.respond(fig4(opposite=opposite))
    assert np.abs(response[f"{still}_rate"]).max() < 1e-13 and np.abs(response[still]).max() < 1e-13
    assert np.abs(response[f"{moving}_rate"]).max() > 1.9
    np.testing.assert_allclose(response["tau2"], (-1 if opposite else 1) * response["tau1"], atol=1e-12)
