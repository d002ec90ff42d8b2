"""Model Exchange through FMPy's solvers, against the oracle and against Co-Simulation of the same FMU."""

from __future__ import annotations

import numpy as np
import pytest
from fmpy import simulate_fmu
from lagrange import OUTPUTS
from reference import integrate

END = 0.5
#: The testbed let go with its couplings wound up, the motors held: nothing depends on how an importer
#: interpolates inputs.
HELD = np.array([0.2, -0.1])
START = {
    "theta3_start": 0.5, "theta4_start": -0.3, "theta5_start": 0.1, "theta6_start": 0.4,
    "omega5_start": 3.0, "omega6_start": -2.0,
}  # fmt: skip

#: Two sines from rest.
AMPLITUDE, FREQUENCY = np.array([0.3, -0.2]), np.array([14.0, 23.0])


def angle(t):
    return AMPLITUDE * (1 - np.cos(FREQUENCY * t))


def rate(t):
    return AMPLITUDE * FREQUENCY * np.sin(FREQUENCY * t)


def simulate(fmu, interval=1e-3, **options):
    return simulate_fmu(str(fmu), stop_time=END, output_interval=interval, output=list(OUTPUTS), **options)


def error(result, expected) -> float:
    """Largest error of any output, relative to the largest value that it takes."""
    return max(
        float(np.max(np.abs(result[name] - expected[name])) / np.max(np.abs(expected[name]))) for name in OUTPUTS
    )


def let_go(fmu, **options):
    held = {"theta1": HELD[0], "theta2": HELD[1]}
    return simulate(fmu, start_values={"start_at_rest": False, **START, **held}, **options)


def true(model, interval=1e-3):
    t = np.linspace(0, END, round(END / interval) + 1)
    return integrate(model, t, lambda s: HELD, lambda s: np.zeros(2), x0=np.array(list(START.values())))


@pytest.mark.parametrize("tolerance", [1e-6, 1e-9])
def test_cvode_meets_its_tolerance(fmu, model, tolerance):
    result = let_go(fmu, fmi_type="ModelExchange", solver="CVode", relative_tolerance=tolerance)
    assert error(result, true(model)) < 100 * tolerance


def test_euler_is_of_first_order(fmu, model):
    def euler(step):
        result = let_go(fmu, fmi_type="ModelExchange", solver="Euler", step_size=step, interval=step)
        return error(result, true(model, step))

    coarse, fine = euler(1e-4), euler(5e-5)
    assert fine < 0.01 and 0.9 < np.log2(coarse / fine) < 1.1, (coarse, fine)


def test_co_simulation_gives_the_same(fmu):
    by_fmu = let_go(fmu, fmi_type="CoSimulation")
    by_solver = let_go(fmu, fmi_type="ModelExchange", solver="CVode", relative_tolerance=1e-9)
    assert error(by_solver, by_fmu) < 1e-7


def test_moving_motors_converge(fmu, model):
    """FMPy holds inputs between its steps, so the error of Model Exchange is of first order in these."""

    def moved(interval):
        t = np.linspace(0, END, round(END / interval) + 1)
        names = ("time", "theta1", "theta2", "omega1", "omega2")
        motors = np.array([(s, *angle(s), *rate(s)) for s in t], dtype=[(name, float) for name in names])
        options = {"fmi_type": "ModelExchange", "solver": "CVode", "relative_tolerance": 1e-8, "input": motors}
        return error(simulate(fmu, interval, **options), integrate(model, t, angle, rate))

    coarse, fine = moved(4e-4), moved(2e-4)
    assert fine < 0.02 and 0.9 < np.log2(coarse / fine) < 1.1, (coarse, fine)
