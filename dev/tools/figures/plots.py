"""Draws the figures: single plots one column wide for the documentation's page, and pages of several plots for the README and for print."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from prw.plots import BLUE, GREEN, PAGE_STYLE, PURPLE, VERMILION, draw_into, motion_panel, response_panels
from tools.figures.bode import draw_bode, transfers
from tools.figures.results import Results, Run

#: Width of a column of the page, inches.
COLUMN = 4.5
#: Keys of the Bode plots of motor 1. The page omits those for motor 2, which are equal by symmetry.
PLOTS_OF_MOTOR_1 = "abcdij"
#: Relative errors up to this value are rounding errors. They differ between machines, so this value is drawn instead.
ROUNDING = 1e-13
#: Time, s, up to which Fig. 4 is drawn.
SHOWN = 1.0


class Drawn(NamedTuple):
    """A figure, and whether it is stored in the repository for the documentation's page or for the README."""

    figure: Figure
    for_page: bool = True
    for_readme: bool = False


def figures(found: Results) -> dict[str, Drawn]:
    """Draws all figures; the keys are file names without suffix."""
    with matplotlib.rc_context(PAGE_STYLE):
        drawn = {
            "fig4_pair": Drawn(_fig4_plate(found), for_page=False, for_readme=True),
            "fig4_opposite": Drawn(_velocities(found.fig4)),
            "fig4_equal": Drawn(_velocities(found.fig4_equal)),
        }
        of_shafts, of_torques = transfers(found)
        for plate, panels in (("fig5", of_shafts), ("torques", of_torques)):
            whole = Figure(figsize=(2 * COLUMN, 2.75 * len(panels) / 2), layout="constrained")
            subfigures = np.asarray(whole.subfigures(len(panels) // 2, 2)).T.flat
            for panel, subfigure in zip(panels, subfigures):
                draw_bode(subfigure, panel)
                single = Figure(figsize=(COLUMN, 2.9), layout="constrained")
                draw_bode(single, panel)
                drawn[f"{plate}_{panel.key}"] = Drawn(single, for_page=panel.key in PLOTS_OF_MOTOR_1)
            drawn[plate] = Drawn(whole, for_page=False)
        drawn["poles"] = Drawn(_poles(found))
        drawn["steps"] = Drawn(_steps(found))
        drawn["convergence"] = Drawn(_convergence(found))
    return drawn


def _velocities(run: Run) -> Figure:
    figure = Figure(figsize=(COLUMN, 5.2), layout="constrained")
    _draw_velocities(figure, run)
    return figure


def _draw_velocities(figure: Any, run: Run) -> None:
    motion, response = run
    first = motion.time <= SHOWN
    omega = None if motion.omega is None else motion.omega[first]
    motion = replace(motion, time=motion.time[first], theta=motion.theta[first], omega=omega)
    response = {name: values[first] for name, values in response.items()}
    panels = [motion_panel(motion, angles=False), *response_panels(response, angles=False)]
    draw_into(figure, motion.time, panels)


def _fig4_plate(found: Results) -> Figure:
    """Draws Fig. 4, with opposite motor rates, next to the same plots with equal motor rates."""
    figure = Figure(figsize=(2 * COLUMN, 4.8), layout="constrained")
    left, right = np.asarray(figure.subfigures(1, 2, wspace=0.04))
    for subfigure, title, run in (
        (left, "Opposite motors: the wrist rolls (Fig. 4)", found.fig4),
        (right, "Equal motors: the wrist pitches", found.fig4_equal),
    ):
        subfigure.suptitle(title, x=0.01, ha="left", fontsize=10, fontweight="bold")
        _draw_velocities(subfigure, run)
    return figure


def _poles(found: Results) -> Figure:
    figure = Figure(figsize=(COLUMN, 3.0), layout="constrained")
    axis = figure.subplots()
    for mode, name, colour, marker in zip(found.modes, ("pitch", "roll"), (GREEN, PURPLE), "x+"):
        poles, zeros = mode.poles(), mode.zeros()
        cross: dict[str, Any] = {"color": colour, "markersize": 9, "markeredgewidth": 1.6}
        axis.plot(poles.real, poles.imag, marker, linestyle="none", label=f"poles of {name}", **cross)
    axis.plot(zeros.real, zeros.imag, "o", color="black", fillstyle="none", markersize=7, label="zeros of both")
    axis.axvline(0, color="black", linewidth=0.8)
    axis.set_xlabel("real part (1/s)")
    axis.set_ylabel("imaginary part (1/s)")
    axis.set_xlim(-290, 15)
    axis.set_ylim(-48, 48)
    axis.legend(loc="upper left")
    return figure


def _steps(found: Results) -> Figure:
    figure = Figure(figsize=(COLUMN, 4.4), layout="constrained")
    axes = figure.subplots(2, sharex=True)
    angles = [("pitch", found.pitch_step, GREEN), ("roll", found.roll_step, PURPLE)]
    for axis, kind, title, unit in (
        (axes[0], "", "Angle after a step of 1° at the motors", "deg"),
        (axes[1], "_rate", "Rate", "deg/s"),
    ):
        axis.set_title(title)
        axis.set_ylabel(unit)
        for name, step, colour in angles:
            (fine, curve), (coarse, points) = step
            line = {"label": f"{name}, motors {'equal' if name == 'pitch' else 'opposite'}", "color": colour}
            axis.plot(fine.time, np.rad2deg(curve[name + kind]), **line)
            axis.plot(coarse.time[2:], np.rad2deg(points[name + kind])[2:], "o", color=colour, markersize=3)
    axes[0].legend(loc="lower right")
    axes[-1].set_xlabel("time (s)")
    axes[-1].set_xlim(-0.02, 0.6)
    figure.align_ylabels(axes)
    return figure


def _power_of_ten(value: float) -> str:
    """Formats a power of ten with superscript characters: 10⁻³. Unlike matplotlib's mathtext, they scale with the other text."""
    exponent = round(float(np.log10(value)))
    return "1" if exponent == 0 else "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _convergence(found: Results) -> Figure:
    step, angles, _, piecewise_linear = found.convergence
    figure = Figure(figsize=(COLUMN, 3.4), layout="constrained")
    axis = figure.subplots()
    milliseconds = 1e3 * step
    for label, marker, name in (("torque", "s", "tau1"), ("roll rate", "^", "roll_rate"), ("roll", "o", "roll")):
        axis.loglog(milliseconds, angles[name], f"{marker}-", color=BLUE, markersize=4, label=f"{label}, angles only")
    rounding = np.maximum(np.max(list(piecewise_linear.values()), axis=0), ROUNDING)
    label = f"all outputs, piecewise linear angles (< {ROUNDING:g})"
    axis.loglog(milliseconds, rounding, "D:", color=VERMILION, markersize=4, label=label)
    axis.set_xticks(milliseconds, [f"{value:g}" for value in milliseconds])
    axis.set_xticks([], minor=True)
    axis.set_xlabel("step (ms)")
    axis.set_ylabel("largest error / largest value")
    axis.set_ylim(1e-14, 1)
    axis.yaxis.set_major_formatter(lambda value, _: _power_of_ten(value))
    axis.legend(loc="center left", bbox_to_anchor=(0, 0.42))
    return figure
