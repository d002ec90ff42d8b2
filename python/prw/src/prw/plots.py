"""Figures of a simulation. Colours are from Okabe and Ito's set, which can be distinguished with any colour vision."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from prw.motion import Array, Motion

BLUE, VERMILION = "#0072B2", "#D55E00"
#: Colours of pitch and roll. BLUE and VERMILION are the colours of motor 1 and motor 2.
GREEN, PURPLE = "#009E73", "#CC79A7"
STYLE: Any = {
    "font.family": "DejaVu Sans",  # included in matplotlib
    "font.size": 10,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.9",
    "axes.axisbelow": True,
    "lines.linewidth": 1.3,
    "legend.frameon": False,
    # SVG files contain text as text, and the identifiers in the file of a figure are always the same.
    "svg.fonttype": "none",
    "svg.hashsalt": "prw",
}
#: Style of figures that are a column wide.
PAGE_STYLE: Any = {
    **STYLE,
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.labelsize": 9,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
}
#: Number of intervals into which a long curve is divided. Only the extremes in each are drawn, because a figure has fewer pixels.
INTERVALS = 4000
#: If all curves of a panel are below this, the scale is -1 to 1, so that rounding errors look like zero.
ROUNDING = 1e-9


@dataclass(frozen=True)
class Panel:
    """One set of axes: title, y label with unit, two curves as (legend entry, values (n,)) with their colours, and measured
    values (n,) of these curves, in the same unit."""

    title: str
    label: str
    curves: Sequence[tuple[str, Array]]
    colours: tuple[str, str] = (BLUE, VERMILION)
    measured: Sequence[Array] = ()


class ShownFigure(Figure):
    """A figure that notebooks show, with or without pyplot."""

    def _repr_png_(self) -> bytes:
        file = io.BytesIO()
        self.savefig(file, format="png", dpi=100)
        return file.getvalue()


def motion_panel(motion: Motion, angles: bool) -> Panel:
    """The motors: their angles in degrees or, if `angles` is false and the motion has them, their velocities as in Fig. 4."""
    if angles or motion.omega is None:
        label, (y1, y2) = "θ₁, θ₂  (deg)", np.rad2deg(motion.theta.T)
        return Panel("Motor angles", label, [("motor 1", y1), ("motor 2", y2)])
    label, (y1, y2) = "θ₁′, θ₂′  (rad/s)", motion.omega.T
    return Panel("Motor velocities", label, [("motor 1", y1), ("motor 2", y2)])


def response_panels(response: Mapping[str, Array], angles: bool, measured: Mapping[str, Array] = {}) -> list[Panel]:
    """The wrist: pitch and roll rates (with `angles` also the angles in degrees), and the sensor torques, if `response` has
    them; and the measured values of these outputs."""

    def panel(
        title: str,
        label: str,
        names: tuple[str, str],
        entries: tuple[str, str],
        colours: tuple[str, str],
        factor: float,
    ) -> list[Panel]:
        if not set(names) <= set(response):
            return []
        curves = [(entry, factor * response[name]) for name, entry in zip(names, entries)]
        return [Panel(title, label, curves, colours, [factor * measured[name] for name in names if name in measured])]

    wrist, motors, degree = (GREEN, PURPLE), (BLUE, VERMILION), float(np.rad2deg(1))
    outputs, shafts, sensors = ("pitch", "roll"), ("shaft 1", "shaft 2"), ("sensor 1", "sensor 2")
    found = []
    if angles and not {"theta3", "theta4"}.isdisjoint(measured):
        found += panel("Shaft angles", "θ₃, θ₄  (deg)", ("theta3", "theta4"), shafts, motors, degree)
    if angles:
        found += panel("Pitch and roll angles", "θ₇, θ₈  (deg)", ("pitch", "roll"), outputs, wrist, degree)
    found += panel("Pitch and roll rates", "θ₇′, θ₈′  (rad/s)", ("pitch_rate", "roll_rate"), outputs, wrist, 1.0)
    return found + panel("Sensor torques", "τ₁, τ₂  (N m)", ("tau1", "tau2"), sensors, motors, 1.0)


def draw_response(
    title: str, motion: Motion, response: Mapping[str, Array], angles: bool, measured: Mapping[str, Array] = {}
) -> Figure:
    """Motor motion, pitch and roll, and torques over time.

    angles: show motor and output angles, as for a recording; otherwise motor velocities, as in Fig. 4. measured: outputs that
    are drawn over those of `response`; the angles of the shafts have a panel only if they were measured.
    """
    panels = response_panels(response, angles, measured)
    return draw_panels(title, motion.time, [motion_panel(motion, angles), *panels])


def draw_panels(title: str, time: Array, panels: Sequence[Panel], height: float = 2.1) -> Figure:
    """A figure of panels, one below the other, over the same time (n,) in s. height: of a panel, inches."""
    with matplotlib.rc_context(STYLE):
        figure = ShownFigure(figsize=(8, 0.8 + height * len(panels)), layout="constrained")
        figure.suptitle(title, x=0.01, ha="left", fontsize=12, fontweight="bold")
        draw_into(figure, time, panels)
    return figure


def draw_into(figure: Any, time: Array, panels: Sequence[Panel]) -> None:
    """Draw the panels over time (n,) in s, one below the other, into a figure or subfigure."""
    axes = figure.subplots(len(panels), sharex=True, squeeze=False)[:, 0]
    for axis, panel in zip(axes, panels):
        _draw_panel(axis, time, panel)
    figure.align_ylabels(axes)
    axes[-1].set_xlabel("time (s)")
    axes[-1].set_xlim(time[0], time[-1])


def _draw_panel(axis: Axes, time: Array, panel: Panel) -> None:
    """Draw the panel's two curves over time (n,) in s, with a legend at the right end of the title's line. Measured values are
    thin dark lines over thick pale curves, so that both are visible where they agree."""
    axis.set_title(panel.title)
    axis.set_ylabel(panel.label)
    # The second curve is dashed, so that two equal curves still show as two; a dense one is translucent instead.
    dense = len(time) > 2 * INTERVALS
    second: dict[str, Any] = {"alpha": 0.6} if dense else {"dashes": (4, 2)}
    for (name, y), colour, style in zip(panel.curves, panel.colours, ({}, second)):
        if panel.measured:
            style = {"linewidth": 3, "alpha": 0.6}
        axis.plot(*envelope(time, y), color=colour, label=name, **style)
    for label, y in zip(["measured", None], panel.measured):
        known = ~np.isnan(y)
        if known.any():
            axis.plot(*envelope(time[known], y[known]), color="0.15", linewidth=0.8, label=label)
    axis.legend(loc="lower right", bbox_to_anchor=(1, 0.97), ncols=3, borderaxespad=0)
    axis.margins(x=0, y=0.08)
    if max(np.abs(y).max() for _, y in panel.curves) < ROUNDING:
        axis.set_ylim(-1, 1)


def envelope(time: Array, y: Array, intervals: int = INTERVALS) -> tuple[Array, Array]:
    """The curve y (n,) over time (n,), reduced to the extremes in each interval: at most 2 * intervals points, which
    look the same when drawn."""
    if len(time) <= 2 * intervals:
        return time, y
    starts = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], intervals, endpoint=False)))
    keep: set[int] = set()
    for start, stop in zip(starts, [*starts[1:], len(time)]):
        keep.update((start + int(y[start:stop].argmin()), start + int(y[start:stop].argmax())))
    kept = sorted(keep)
    return time[kept], y[kept]
