"""Derivatives of trajectories: compared with the complex-step derivatives of the oracle, and with functions that have a known noise."""

from __future__ import annotations

from functools import partial

import fmu_run
import numpy as np
import pytest
from fmu_run.sensitivities import differentiate
from lagrange import linear_model, table_1
from reference import at_rest, follow

import prw
from prw.motion import fig4

NAMES = ("J2", "J3", "H3", "k1", "k2", "c1", "c2", "c3")


def test_sensitivities_are_the_derivatives_of_the_exact_solution(testbed) -> None:
    motion = fig4(1e-2, opposite=False)
    motion = prw.Motion(motion.time, motion.theta * [1, 0.3], motion.omega * [1, 0.3])
    found = prw.sensitivities(motion, values={"k1": 100.0}, outputs=("pitch", "roll", "tau1"), fmu=testbed)
    assert len(found) == 24 and list(found.at) == list(NAMES) and "roll by k1: up to" in repr(found)
    table = {**table_1(), "k1": 100.0}
    for name in NAMES:
        tiny = 1e-20 * table[name]
        model = linear_model({**table, name: table[name] + 1j * tiny})
        at, _ = follow(model, motion.time, motion.theta, motion.omega, at_rest(motion.theta[0]))
        for output in ("pitch", "roll", "tau1"):
            exact, error = at[output].imag / tiny, found.errors[output, name]
            assert np.abs(found[output, name] - exact).max() <= 3 * error + 1e-12 * np.abs(exact).max(), (output, name)
            assert error < 1e-8 * np.abs(exact).max() + 1e-11 * np.abs(at[output]).max() / table[name]


def test_parameters_that_are_0(testbed) -> None:
    """A parameter at the end of its range cannot be varied, and others need a step."""
    few = {"parameters": ["c3"], "outputs": "roll", "fmu": testbed}
    with pytest.raises(prw.UserError, match=r"parameters: c3 is 0, the least value .* as in values=\{'c3': 1e-3\}"):
        prw.sensitivities(values={"c3": 0.0}, **few)
    states = {"parameters": "theta5_start", "values": {"start_at_rest": False}, "outputs": "roll", "fmu": testbed}
    with pytest.raises(prw.UserError, match=r"theta5_start is 0; give its largest step, as in steps="):
        prw.sensitivities(**states)
    # eq. (1): roll is N / 2M times the difference of theta5 and theta6.
    assert prw.sensitivities(steps={"theta5_start": 0.1}, **states)["roll", "theta5_start"][0] == pytest.approx(7 / 8)
    with pytest.raises(prw.UserError, match="steps: k1 is not known"):
        prw.sensitivities(steps={"k1": 1.0}, **few)


class Noisy(dict):
    """Results of runs of exp(k t), with errors of a solver of this relative size."""

    def __init__(self, start, noise):
        self.time, self.ok, self.errors = np.linspace(0, 1, 20), np.abs(start["k"]) < 10.1, {0: "k is too large"}
        exact = np.exp(np.outer(start["k"], self.time))
        super().__init__(y=exact * (1 + noise * np.random.default_rng(1).uniform(-1, 1, exact.shape)))


def test_steps_follow_the_noise() -> None:
    """The more noise, the larger the step and the estimated error, which the actual error does not exceed by more than a factor of 3."""
    errors, steps = [], []
    for noise in (0.0, 1e-10, 1e-7, 1e-4):
        found = differentiate(partial(Noisy, noise=noise), ["y"], {"k": 2.0}, {"k": 0.25})
        exact = found.time * np.exp(2.0 * found.time)
        errors.append(found.errors["y", "k"])
        steps.append(found.steps["y", "k"])
        assert np.abs(found["y", "k"] - exact).max() < 3 * errors[-1] < 1000 * max(noise, 1e-11) * exact.max()
    assert errors == sorted(errors) and steps == sorted(steps) and steps[0] < steps[-1]
    # The two largest steps of k = 10 are rejected.
    found = differentiate(lambda start: Noisy(start, 0.0), ["y"], {"k": 10.0}, {"k": 1.0})
    assert found.steps["y", "k"] < 0.1 and found.errors["y", "k"] < 1e-5 * np.exp(10)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"parameters": "theta3_start"}, "theta3_start is 0; give its largest step, as in steps={'theta3_start': 0.1}"),
        ({"parameters": "k9"}, "the FMU has no variable 'k9'"),
        ({"parameters": []}, "name at least one"),
        ({"parameters": "k1", "start": {"k1": [1.0, 2.0]}}, r"k1 has the shape \(2,\); sensitivities need one value"),
        ({"parameters": "k1", "steps": {"k2": 1.0}}, "steps: 'k2' is not among the parameters k1"),
        ({"parameters": "k1", "steps": {"k1": "1"}}, "steps: k1: '1' is not a number"),
        ({"parameters": "k1", "measures": ["rms"]}, "measures are not differentiated; calculate them"),
        (
            {"parameters": "k1", "inputs": {"theta1": np.ones((12, 2))}},
            r"inputs: theta1 has the shape \(12, 2\); sensitivities need the same for all runs",
        ),
        (
            {"parameters": "k1", "inputs": {"theta1": ([0.0, 1.0], np.ones((12, 2)), "deg")}},
            r"theta1 has the shape \(12, 2\)",
        ),
        ({"parameters": "k1", "start": {"k2": (np.ones(12), "N.m/deg")}}, r"start: k2 has the shape \(12,\); sensitiv"),
        ({"parameters": "c1", "steps": {"c1": 1e9}}, "c1 cannot be varied about .*c1 must not be below 0"),
    ],
)
def test_errors(testbed, arguments, message) -> None:
    with fmu_run.Fmu(testbed) as fmu, pytest.raises(ValueError, match=message):
        fmu.sensitivities([0.0, 0.1], outputs=["roll"], **arguments)


def test_units_and_own_steps(testbed) -> None:
    with fmu_run.Fmu(testbed) as fmu:
        time, start = np.linspace(0, 0.1, 11), {"k1": (2.0, "N.m/deg"), "start_at_rest": False}
        found = fmu.sensitivities(
            time, outputs=["theta3"], parameters=["k1", "theta3_start"], start=start, steps={"theta3_start": 0.1}
        )
    assert found.at == {"k1": pytest.approx(360 / np.pi), "theta3_start": 0.0}
    assert found["theta3", "theta3_start"][0] == pytest.approx(1.0, abs=1e-12)
