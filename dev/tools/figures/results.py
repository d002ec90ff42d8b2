"""The data of the figures, from runs of the FMU."""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import matplotlib
import numpy as np

from prw.linearization import linearize
from prw.motion import Motion, fig4
from prw.state_space import StateSpace
from prw.testbed import ANGLE_OF, Testbed
from tools.convergence import Convergence, convergence, order
from tools.frequency import SHAFTS, TORQUES, decibels, sweep
from tools.modes import Mode, pitch_and_roll

#: Frequencies in Hz of the curves of the Bode plots, and of the measured points.
CURVE = np.geomspace(0.1, 1000, 321)
POINTS = 10 ** (np.arange(-6, 16) / 6)
#: The page of the FMU states the deviation of the measured points from the curves up to this frequency in Hz.
STATED = 50.0

Run = tuple[Motion, dict[str, np.ndarray]]


class Step(NamedTuple):
    """The response to motor angles that step by 1 degree at t = 0: finely sampled, and in a few long steps."""

    fine: Run
    coarse: Run


class Results(NamedTuple):
    """The linear model of the FMU, and results of its runs.

    Attributes
    ----------
    model
        The linear model; its outputs are SHAFTS, then TORQUES.
    modes
        Pitch and roll.
    sweep
        Measured response of SHAFTS and TORQUES at POINTS.
    fig4, fig4_equal
        The experiment of Fig. 4, and the same with equal motor rates.
    pitch_step, roll_step
        Responses if both motors step by 1 degree, and if motor 2 steps by -1 degree instead.
    convergence
        Errors for several step sizes.
    """

    model: StateSpace
    modes: tuple[Mode, Mode]
    sweep: np.ndarray
    fig4: Run
    fig4_equal: Run
    pitch_step: Step
    roll_step: Step
    convergence: Convergence


def results(fmu: Path) -> Results:
    """Run and measure the FMU file `fmu`; takes some seconds. Raises UserError if it is missing or rejects a call."""
    model = linearize(fmu=fmu)
    slowest = -np.linalg.eigvals(model.A).real.max()
    return Results(
        linearize(fmu=fmu, outputs=(*SHAFTS, *TORQUES)),
        pitch_and_roll(model),
        sweep(fmu, POINTS, slowest),
        _run(fmu, fig4()),
        _run(fmu, fig4(opposite=False)),
        _step(fmu, (1, 1)),
        _step(fmu, (1, -1)),
        convergence(fmu, model),
    )


def _run(fmu: Path, motion: Motion) -> Run:
    with Testbed(fmu) as testbed:
        return motion, testbed.respond(motion, ("theta5", "theta6", *testbed.loaded.outputs))


def _step(fmu: Path, sides: tuple[int, int]) -> Step:
    before, end, coarse = -0.02, 0.6, 0.025
    # At t = 0 the outputs are unchanged. The impulse through the dampers acts immediately afterwards.
    times = np.array([before, 0, 1e-9, *np.arange(1, 601) * 1e-3]), np.array([before, *np.arange(0, end, coarse), end])
    runs = []
    for time in times:
        theta = np.where(time[:, None] < 0, 0.0, np.deg2rad(1.0) * np.array(sides))
        # A rate of zero holds the angles between the samples.
        runs.append(_run(fmu, Motion(time, theta, np.zeros_like(theta))))
    return Step(runs[0], runs[1])


def numbers(found: Results) -> str:
    """The numbers that the page of the FMU quotes, by name, and the version of matplotlib that drew the figures, as JSON."""
    low = POINTS <= STATED
    ratio = found.sweep / found.model.response_at_hz(POINTS, ANGLE_OF)
    high = found.model.response_at_hz(1e5, ANGLE_OF)
    _, opposite = found.fig4
    _, equal = found.fig4_equal
    late = found.fig4[0].time >= 1.0
    step, angles, rates, _ = found.convergence
    pitch, roll = found.modes

    def rounded(value: complex) -> list[float]:
        return [float(f"{value.real:.6g}"), float(f"{abs(value.imag):.6g}")]

    def orders(errors: dict[str, np.ndarray]) -> dict[str, float]:
        return {name: round(value, 2) for name, value in order(step, errors).items()}

    content = {
        "made_with": f"matplotlib {matplotlib.__version__}",
        "poles": {
            name: sorted(rounded(pole) for pole in mode.poles() if pole.imag >= 0)
            for name, mode in (("pitch", pitch), ("roll", roll))
        },
        "zeros": sorted(rounded(zero) for zero in pitch.zeros()),
        "sweep_points": int(low.sum()),
        "sweep_decibels": float(f"{np.abs(decibels(ratio))[low].max():.2g}"),
        "sweep_degrees": float(f"{np.abs(np.rad2deg(np.angle(ratio)))[low].max():.2g}"),
        "high_frequency_level_H11": round(float(decibels(high)[0, 0, 0]), 2),
        "fig4_roll_rate": float(f"{np.abs(opposite['roll_rate'][late]).max():.3g}"),
        "fig4_torque": float(f"{np.abs(opposite['tau1'][late]).max():.3g}"),
        "fig4_equal_pitch_rate": float(f"{np.abs(equal['pitch_rate'][late]).max():.3g}"),
        "fig4_equal_torque": float(f"{np.abs(equal['tau1'][late]).max():.3g}"),
        "step_pitch_rate": float(f"{np.rad2deg(found.pitch_step.fine[1]['pitch_rate'][2]):.3g}"),
        "step_roll_rate": float(f"{np.rad2deg(found.roll_step.fine[1]['roll_rate'][2]):.3g}"),
        "order_angles": orders(angles),
        "order_rates": orders(rates),
        "error_1ms_percent": {name: float(f"{100 * errors[step == 1e-3][0]:.1g}") for name, errors in angles.items()},
    }
    return json.dumps(content, indent=2) + "\n"
