"""Figures of the closed loop and of the coupling's error."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from prw.commands.simulate import write_png
from prw.plots import BLUE, STYLE, VERMILION, Panel, draw_panels
from tools.validation.coupling import Study
from tools.validation.system import System


def plot_response(path: Path, system: System, values: dict[str, np.ndarray]) -> None:
    """Draw reference and response, motor angles and rates, and torques over time into the PNG `path`."""
    degrees = {name: np.rad2deg(column) for name, column in values.items()}

    def pair(source: dict[str, np.ndarray], name: str, label: str) -> list[tuple[str, np.ndarray]]:
        return [(f"{label} {i}", source[f"{name}{i}"]) for i in (1, 2)]

    panels = [
        Panel("Pitch and roll; their references dotted", "θ₇, θ₈  (deg)",
              [(axis, degrees[f"testbed.{axis}"]) for axis in ("pitch", "roll")]),
        Panel("Motor angles", "θ₁, θ₂  (deg)", pair(degrees, "controller.theta", "motor")),
        Panel("Motor velocities", "θ₁′, θ₂′  (rad/s)", pair(values, "controller.omega", "motor")),
        Panel("Sensor torques", "τ₁, τ₂  (N m)", pair(values, "testbed.tau", "sensor")),
    ]  # fmt: skip
    goals = [np.rad2deg(value) for _, value in system.inputs.values()]
    title = "Closed loop: to {:g}° of pitch and {:g}° of roll".format(*goals)
    figure = draw_panels(title, values["time"], panels)
    for goal, colour in zip(goals, (BLUE, VERMILION)):
        figure.axes[0].axhline(goal, color=colour, linestyle=":", linewidth=1)
    write_png(path, figure)


def plot_coupling(path: Path, study: Study) -> None:
    """Draw the coupling's error over the communication step into the PNG `path`."""
    step = study.step * 1e3
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7, 4.4), layout="constrained")
        axis = figure.subplots()
        axis.set_title("Error of pitch and roll by coupling at communication points (Jacobi)")
        axis.loglog(step, study.held, "o-", color=BLUE, label="inputs held over a step")
        axis.loglog(step, study.derivatives, "s--", color=VERMILION, label="with input derivatives")
        axis.axvline(1, color="0.6", linewidth=1)
        axis.annotate(
            "sample time", (1, axis.get_ylim()[1]), (4, -4), textcoords="offset points", va="top", color="0.4"
        )
        slope = study.derivatives[0] * (step / step[0]) ** 2
        axis.loglog(step, 0.5 * slope, ":", color="0.5", linewidth=1)
        axis.annotate("∝ step²", (step[4], 0.5 * slope[4]), (6, -10), textcoords="offset points", color="0.4")
        axis.set_xlabel("communication step (ms)")
        axis.set_ylabel("largest error (deg)")
        axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_xticks(step)
        axis.minorticks_off()
        axis.legend(loc="upper left")
    write_png(path, figure)
