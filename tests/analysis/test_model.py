"""The FMU as the fit runs it: many sets of parameters, initial states, samples between communication points."""

from __future__ import annotations

import numpy as np
import pytest

from prw.errors import UserError
from prw.identify.model import STATES
from prw.motion import Motion
from prw.testbed import OUTPUTS

OTHER = {"k1": 90.0, "k2": 61.0, "c1": 0.2, "c2": 0.9, "c3": 0.1, "J2": 0.006, "J3": 0.02, "H3": 0.03}


def shaky(n: int, h: float, seed: int = 0) -> Motion:
    """A motion whose angles jump from step to step and whose rates do not belong to them."""
    random = np.random.default_rng(seed)
    t = np.arange(n) * h
    theta = np.column_stack([0.3 * np.sin(20 * t), 0.2 * np.cos(31 * t)]) + random.normal(0, 0.01, (n, 2))
    return Motion(t, theta, random.normal(0, 3, (n, 2)), "shaky")


@pytest.mark.parametrize("every", [1, 4])
@pytest.mark.parametrize("start", [None, [0.1, -0.2, 0.3, 0.05, 2.0, -1.0]], ids=["rest", "moving"])
def test_each_set_of_parameters_has_its_own_run(model, every, start):
    motion = shaky(1001, 2.5e-4)
    first, *rest = ({**model.starts, **values} for values in ({}, OTHER, {"k1": 70.0}))
    found = model.follow(motion, OUTPUTS, [first, *rest], every, start)
    assert found.shape == (3, 1 + 1000 // every, len(OUTPUTS))
    for run, values in enumerate([first, *rest]):
        expected = model.run(motion, values, state=start)
        np.testing.assert_array_equal(found[run], np.column_stack([expected[name][::every] for name in OUTPUTS]))


def test_a_set_that_the_fmu_refuses(model):
    with pytest.raises(UserError, match="k1 must"):
        model.follow(shaky(11, 1e-3), OUTPUTS, [model.starts, {**model.starts, "k1": -1.0}])


def test_initial_state_enters_linearly(model):
    motion = shaky(801, 1e-3)
    values = {**model.starts, **OTHER}
    rest = np.concatenate([motion.theta[0], motion.theta[0], [0, 0]])
    state = rest + [0.01, 0.02, -0.01, 0.03, 1.0, -2.0]
    base, other = (model.follow(motion, OUTPUTS, [values], 1, x)[0] for x in (rest, state))
    # Two steps of 1 ms are one of 2 ms.
    added = model.transients(motion.time[::2], OUTPUTS, values) @ (state - rest)
    assert np.abs(base[::2] + added - other[::2]).max() < 1e-12 * np.abs(other).max()


def test_the_instance_forgets(model):
    motion = shaky(101, 1e-3)
    first = model.run(motion, {})
    model.run(motion, OTHER, state=np.ones(len(STATES)))
    again = model.run(motion, {})
    for name in OUTPUTS:
        np.testing.assert_array_equal(first[name], again[name])
