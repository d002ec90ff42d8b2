"""The paper's statements in Sec. 4 about Figs. 4 and 5 hold for the linear model of the FMU, and in simulations of the FMU."""

from __future__ import annotations

import numpy as np
import pytest
from lagrange import dissipation, hessian, kinetic_energy, potential_energy, table_1

import prw.testbed
from prw.linearization import linearize
from prw.motion import fig4
from prw.testbed import ANGLE_OF
from tools.frequency import SHAFTS, TORQUES, decibels, sweep

P = table_1()


@pytest.fixture(scope="module")
def linear(fmu):
    return linearize(fmu=fmu, outputs=(*SHAFTS, *TORQUES))


def h_of_eq_15(frequency):
    """H(s) of eq. (15), shape (k, 4, 2); M, Delta and K follow from the energies."""
    m, delta, k = (hessian(form, P)[2:, 2:] for form in (kinetic_energy, dissipation, potential_energy))
    s = 2j * np.pi * np.asarray(frequency)[:, None, None]
    return np.linalg.solve(s**2 * m + s * delta + k, np.eye(4)[:, :2] * (P["c1"] * s + P["k1"]))


def torques_of_eq_9(frequency):
    """Transfer functions from motor angles to torques, shape (k, 2, 2): (k1 + c1 s) (q_I - theta)."""
    s = 2j * np.pi * np.asarray(frequency)[:, None, None]
    return (P["k1"] + P["c1"] * s) * (h_of_eq_15(frequency)[:, :2] - np.eye(2))


def test_h_of_the_linear_model_is_eq_15(linear):
    """Compares eleven decades of frequency, so the slopes, levels and symmetry of Fig. 5 are checked, too."""
    frequency = np.geomspace(1e-4, 1e7, 89)
    found = linear.response_at_hz(frequency, ANGLE_OF)
    np.testing.assert_allclose(found[:, :4], h_of_eq_15(frequency), rtol=1e-8)
    np.testing.assert_allclose(found[:, 4:], torques_of_eq_9(frequency), rtol=1e-8)


def test_swept_sines_lie_on_the_curves(fmu):
    """Below 50 Hz, the measured response differs from the equations by at most 0.01 dB and 0.1 degrees."""
    frequency = np.array([0.1, 0.37, 1.1, 2.9, 4.6, 5.3, 6.1, 9.0, 17.0, 31.0, 49.9])
    measured = sweep(fmu, frequency, slowest=9.68)
    ratio = measured / np.concatenate([h_of_eq_15(frequency), torques_of_eq_9(frequency)], axis=1)
    assert np.abs(decibels(ratio)).max() < 0.01
    assert np.abs(np.rad2deg(np.angle(ratio))).max() < 0.1


def test_swept_sines_above_50_hz(fmu):
    frequency = np.array([80.0, 200.0])
    ratio = sweep(fmu, frequency, slowest=9.68, outputs=SHAFTS) / h_of_eq_15(frequency)
    assert np.abs(decibels(ratio)).max() < 0.01 and np.abs(np.rad2deg(np.angle(ratio))).max() < 0.1


@pytest.mark.parametrize("opposite, still, moving", [(True, "pitch", "roll"), (False, "roll", "pitch")])
def test_fig4_and_its_counterpart(fmu, opposite, still, moving):
    """Opposite motor velocities leave the pitch rate at zero; equal motor velocities leave the roll rate at zero."""
    with prw.testbed.Testbed(fmu) as testbed:
        response = testbed.respond(fig4(opposite=opposite))
    assert np.abs(response[f"{still}_rate"]).max() < 1e-13 and np.abs(response[still]).max() < 1e-13
    assert np.abs(response[f"{moving}_rate"]).max() > 1.9
    np.testing.assert_allclose(response["tau2"], (-1 if opposite else 1) * response["tau1"], atol=1e-12)
