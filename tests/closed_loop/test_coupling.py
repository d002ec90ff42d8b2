"""What coupling costs: the order of the error over the communication step, with and without input derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from tools.validation import coupling


@pytest.fixture(scope="module")
def study(closed_loop):
    return coupling.study(closed_loop)


def test_up_to_the_sample_time_derivatives_change_nothing_and_the_order_is_two(study):
    """The controller sees every sample as it is; what is left is the testbed's line for the motors' parabola."""
    fine = study.step <= 1.001e-3
    np.testing.assert_allclose(study.held[fine], study.derivatives[fine], rtol=1e-6)
    order = np.diff(np.log(study.held[fine])) / np.diff(np.log(study.step[fine]))
    assert np.all((order > 1.9) & (order < 2.1)), order
    assert study.held[fine][-1] < 1e-3


def test_beyond_it_derivatives_keep_the_order(study):
    coarse = (study.step >= 0.999e-3) & (study.step <= 8.001e-3)
    step, held, derivatives = study.step[coarse], study.held[coarse], study.derivatives[coarse]
    order = np.diff(np.log(derivatives)) / np.diff(np.log(step))
    assert np.all((order > 1.8) & (order < 2.2)), order
    # Held inputs reach the samples inside a step late: of first order.
    assert np.all(held[1:] > 1.5 * derivatives[1:])
    order = np.diff(np.log(held[1:])) / np.diff(np.log(step[1:]))
    assert np.all(order < 1.8), order
