"""Steps with parameters up to a billion times smaller or larger than Table 1, with sizes from a nanosecond to hours; a million steps.

PRW_EXTREME_CASES sets the number of random testbeds.
"""

from __future__ import annotations

import ctypes
import os

import mpmath
import numpy as np
import pytest
from lagrange import OUTPUTS, REAL, linear_model, table_1, varied
from reference import augmented, exponential

STATES = ("theta3", "theta4", "theta5", "theta6", "omega5", "omega6")
CASES = int(os.environ.get("PRW_EXTREME_CASES", "12"))
#: Digits of the oracle. The scaling and squaring of the largest of these matrices loses more than 25 digits.
DIGITS = 120

many = np.vectorize(mpmath.mpf, otypes=[object])


def larger_of_pair(values):
    """Replaces both values of each pair (theta3 and theta4, ...) by the larger one."""
    pairs = np.asarray(values).reshape(-1, 2)
    return np.repeat(pairs.max(axis=1), 2)


class Size:
    """A number that is calculated like a value, except that every term is added with its magnitude."""

    def __init__(self, value):
        self.value = abs(value)

    def __add__(self, other):
        return Size(self.value + other.value)

    def __mul__(self, factor):
        return Size(self.value * abs(factor.value if isinstance(factor, Size) else factor))

    def __truediv__(self, divisor):
        return Size(self.value / abs(divisor))

    __sub__, __rmul__ = __add__, __mul__


sized = np.vectorize(Size, otypes=[object])


class Exact:
    """Exact step of one testbed with one step size. The matrix exponential has enough digits for all parameters."""

    def __init__(self, parameters, h):
        self.model = linear_model({name: mpmath.mpf(value) for name, value in parameters.items()})
        self.h = mpmath.mpf(h)
        self.step_matrix = exponential(augmented(self.model) * self.h)[:6]

    def step(self, x, theta, slope, jump=None):
        """Returns the states and outputs (14,) after a step, and their scales (14,), with which errors are compared.

        The arguments are the states x (6,), the motor angles theta (2,), their slopes (2,) and their jump (2,) at the
        start of the step. A relative error of 1e-16 in an argument changes a result by at most 1e-16 of the result's scale.
        Both values of a pair, such as theta3 and theta4, have the same scale, because the FMU steps their sum and difference.
        The scale of an angle is at least the angle at the start, to which the FMU adds the change during the step.
        """
        x, theta, slope = many(x), many(theta), many(slope)
        model, size = self.model, np.abs(x)
        if jump is not None:
            before = theta - many(jump)
            x = x + model.impulse(theta - before)
            size = size + abs(np.stack([model.impulse(row) for row in np.eye(2, dtype=int) * many(1)]).T) @ abs(theta)
        end = self.step_matrix @ np.concatenate([x, theta, slope])
        size = abs(self.step_matrix) @ np.concatenate([size, abs(theta), abs(slope)])
        size[:4] += abs(x[:4])
        size = larger_of_pair(size)
        theta = theta + slope * self.h
        outputs = model.outputs(end, theta, slope)
        sizes = model.outputs(*(sized(larger_of_pair(abs(values))) for values in (size, theta, slope)))
        sizes = [sizes[name].value for name in OUTPUTS]
        return np.concatenate([end, [outputs[name] for name in OUTPUTS]]), np.concatenate([size, sizes])


def check(instance, parameters, h, seed, steps=3):
    """Makes `steps` steps with jumps of the motor angles between them. Returns the largest error of the states and outputs,
    relative to their scales."""
    rng = np.random.default_rng(seed)
    instance.fmi.setupExperiment(startTime=0.0)
    instance.set(**{name: int(value) if name in "MN" else float(value) for name, value in parameters.items()})
    instance.set(start_at_rest=False, **dict(zip((f"{name}_start" for name in STATES), rng.uniform(-1, 1, 6))))
    instance.fmi.enterInitializationMode()
    instance.fmi.exitInitializationMode()
    angles = [instance.variables[name].valueReference for name in ("theta1", "theta2")]
    worst, path, exact = 0.0, None, Exact(parameters, h)
    for k in range(steps):
        x, theta, slope = instance.get(*STATES), rng.uniform(-1, 1, 2), rng.uniform(-5, 5, 2)
        instance.fmi.setReal(angles, theta)
        instance.fmi.setRealInputDerivatives(angles, [1, 1], slope)
        instance.step(k * h, h)
        true_values, size = exact.step(x, theta, slope, None if path is None else many(theta) - path)
        path = many(theta) + many(slope) * exact.h
        found = instance.get(*STATES, *OUTPUTS)
        assert np.all(np.isfinite(found))
        worst = max(worst, float(max(abs(many(found) - true_values) / size)))
    assert not instance.unexpected_messages()
    return worst


def random_parameters(rng):
    """Multiplies each Real parameter of Table 1 by a factor from 1e-9 to 1e9; in a third of the cases by 1e-9, 1 or 1e9. M and N are
    drawn from a list."""
    ends = rng.uniform() < 1 / 3
    decades = rng.choice([-9, 0, 9], len(REAL)) if ends else rng.uniform(-9, 9, len(REAL))
    lobes, rollers = rng.choice([1, 4, 7, 1000, 2**31 - 1], 2)
    return {**varied([10.0**d for d in decades]), "M": lobes, "N": rollers}


@pytest.mark.parametrize("seed", range(CASES))
def test_far_from_table_1(instance, seed):
    rng = np.random.default_rng(seed)
    parameters, h = random_parameters(rng), float(10 ** rng.uniform(-9, 4))
    with mpmath.workdps(DIGITS):
        error = check(instance, parameters, h, seed)
    print(f"{error:.1e}, step {h:.1e} s, {parameters}")
    assert error < 1e-13


@pytest.mark.parametrize(
    "factors",
    [
        {},
        {"k1": 1e9, "k2": 1e-9, "J2": 1e9, "c2": 1e9},
        # With almost no damping, rounding errors of all steps remain until the end.
        {"c1": 1e-9, "c2": 1e-9, "c3": 1e-9},
    ],
)
def test_a_million_steps(instance, factors):
    # The motor angles are linear in time and exact in binary, so all steps together equal one long step.
    steps, h, slope = 1_000_000, 2.0**-10, np.array([0.75, -0.5])
    parameters = {name: value * factors.get(name, 1) for name, value in table_1().items()}
    parameters.update(M=4, N=7)
    instance.start((0.0, 0.0), rate=slope, **parameters)
    names = ("theta1", "theta2")
    references = (ctypes.c_uint * 2)(*(instance.variables[name].valueReference for name in names))
    theta, component = (ctypes.c_double * 2)(), instance.fmi.component
    set_real, do_step = instance.fmi.fmi2SetReal, instance.fmi.fmi2DoStep
    for k in range(steps):
        t = k * h
        theta[0], theta[1] = t * slope[0], t * slope[1]
        set_real(component, references, 2, theta)
        do_step(component, t, h, 1)
    found = instance.get(*STATES, *OUTPUTS)
    assert not instance.unexpected_messages()
    with mpmath.workdps(DIGITS):
        exact = Exact(parameters, steps * h)
        true_values, size = exact.step(np.zeros(6), np.zeros(2), slope)
        # Each step rounds the angles, and the springs convert these errors to errors of the velocities.
        rate = mpmath.sqrt(abs(exact.model.a[4:, :4]).max())
        for velocity, angle in (4, 2), (5, 3), (10, 8), (11, 9):
            size[velocity] += rate * size[angle]
        error = abs(many(found) - true_values) / size
    print([f"{float(e):.1e}" for e in error])
    assert max(error) < 1e-11
