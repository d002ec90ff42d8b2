"""Angles alone: every output converges with the square of the step."""

from __future__ import annotations

import numpy as np
import pytest
from lagrange import OUTPUTS
from reference import integrate

AMPLITUDE, FREQUENCY, PHASE = np.array([0.3, 0.2]), np.array([14.0, 23.0]), np.array([0.4, 1.9])
END = 1.0
#: Repeated step sizes, in units of their mean.
SPACING = {"even": [1.0, 1.0, 1.0, 1.0], "uneven": [0.4, 1.5, 0.8, 1.3]}
#: The first samples know no slope; judged from here on.
FROM = 0.3


def angle(t):
    return AMPLITUDE * np.sin(FREQUENCY * t + PHASE)


def rate(t):
    return AMPLITUDE * FREQUENCY * np.cos(FREQUENCY * t + PHASE)


def error(make_instance, model, spacing, steps, reading):
    t = np.concatenate([[0], np.cumsum(np.tile(spacing, steps // 4))]) * END / steps
    theta = np.array([angle(s) for s in t])
    instance = make_instance()
    instance.start(theta[0])
    at, after = instance.run(t, theta)
    found = {"at": at, "after": {name: np.concatenate([[0], after[name]]) for name in OUTPUTS}}[reading]
    true = integrate(model, t, angle, rate)
    late = t >= FROM
    return {name: np.max(np.abs(found[name] - true[name])[late]) for name in OUTPUTS}


@pytest.mark.parametrize("spacing", SPACING)
@pytest.mark.parametrize("reading", ["at", "after"])
def test_second_order_from_angles_alone(make_instance, model, spacing, reading):
    """Outputs read with the new angles set ("at") and right after the step, as most importers do ("after")."""
    errors = [error(make_instance, model, SPACING[spacing], steps, reading) for steps in (200, 400, 800)]
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
