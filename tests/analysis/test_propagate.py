"""The recurrence that stands in for the FMU in the fit, against the FMU itself."""

from __future__ import annotations

import numpy as np
import pytest

from prw.identify import propagate
from prw.identify.model import STATES, stack
from prw.motion import Motion
from prw.testbed import OUTPUTS

OTHER = {"k1": 90.0, "k2": 61.0, "c1": 0.2, "c2": 0.9, "c3": 0.1, "J2": 0.006, "J3": 0.02, "H3": 0.03}


def shaky(n: int, h: float, seed: int = 0) -> Motion:
    """A motion whose angles jump from step to step and whose rates do not belong to them."""
    random = np.random.default_rng(seed)
    t = np.arange(n) * h
    theta = np.column_stack([0.3 * np.sin(20 * t), 0.2 * np.cos(31 * t)]) + random.normal(0, 0.01, (n, 2))
    return Motion("shaky", t, theta, random.normal(0, 3, (n, 2)))


@pytest.mark.parametrize("n, every", [(5, 1), (2001, 4), (1000, 1), (1001, 8)])
@pytest.mark.parametrize("values", [{}, OTHER], ids=["table 1", "other"])
def test_same_numbers_as_the_fmu(model, values, n, every):
    n = (n - 1) // every * every + 1
    motion = shaky(n, 2.5e-4)
    start = np.array([0.1, -0.2, 0.3, 0.05, 2.0, -1.0])
    for state in (None, start):
        expected = model.run(motion, values, state=state)
        found = propagate.outputs(
            stack([model.matrices(values)] * 2), 2.5e-4, motion.theta, motion.omega, every, state
        )
        for i, name in enumerate(OUTPUTS):
            scale = np.abs(expected[name]).max()
            assert np.abs(found[1, :, i] - expected[name][::every]).max() < 1e-12 * scale, name


def test_initial_state_enters_linearly(model):
    motion = shaky(801, 1e-3)
    rest = np.concatenate([motion.theta[0], motion.theta[0], [0, 0]])
    state = rest + [0.01, 0.02, -0.01, 0.03, 1.0, -2.0]
    models = stack([model.matrices(OTHER)])
    base, other = (propagate.outputs(models, 1e-3, motion.theta, motion.omega, 1, x)[0] for x in (rest, state))
    added = propagate.transients(models, 1e-3, 801)[0] @ (state - rest)
    assert np.abs(base + added - other).max() < 1e-12 * np.abs(other).max()


def test_the_instance_forgets(model):
    motion = shaky(101, 1e-3)
    first = model.run(motion, {})
    model.run(motion, OTHER, state=np.ones(len(STATES)))
    again = model.run(motion, {})
    for name in OUTPUTS:
        np.testing.assert_array_equal(first[name], again[name])
