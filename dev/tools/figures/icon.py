"""The block icons. Testbed: a roller-carrier at either side, the lobed cam between them, the load on its shaft.
Controller: the cam, and an angle that goes to its reference.

Figures of two inches square, on white so that they show on any canvas; clear at 64 pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Polygon

from prw.motion import Array

INK, BLUE, GREEN, GREY, ORANGE = "#1c2126", "#2f8fd0", "#27a17c", "#c9ced3", "#d55e00"
EDGE: dict[str, Any] = {"edgecolor": INK, "linewidth": 2.2, "joinstyle": "round"}


def draw_testbed() -> Figure:
    """The icon of the testbed."""
    figure, axis = _card()
    line: dict[str, Any] = {"color": INK, "linewidth": 5, "solid_capstyle": "butt"}
    axis.plot([-0.95, -0.5], [-0.28, -0.28], **line)
    axis.plot([0.5, 0.95], [-0.28, -0.28], **line)
    axis.plot([0, 0], [0.1, 0.5], **line)
    for side in (-1, 1):
        # The carrier, and its rollers towards the cam.
        carrier = [(side * 0.62, 0.2), (side * 0.46, 0.2), (side * 0.46, -0.76), (side * 0.62, -0.76)]
        axis.add_patch(Polygon(carrier, facecolor=BLUE, **EDGE))
        for height in (0.06, -0.28, -0.62):
            axis.add_patch(Circle((side * 0.35, height), 0.105, facecolor=GREY, **EDGE))
    axis.add_patch(Polygon(_cam(0, -0.28, 0.29), facecolor=GREEN, **EDGE))
    # Gripper.
    right = [(0.2, 0.44), (0.28, 0.88), (0.15, 0.88), (0.09, 0.58)]
    left = [(-x, y) for x, y in reversed(right)]
    axis.add_patch(Polygon(right + left, facecolor=ORANGE, **EDGE))
    return figure


def draw_controller() -> Figure:
    """The icon of the controller."""
    figure, axis = _card()
    axis.plot([-0.7, -0.7, 0.74], [0.72, -0.7, -0.7], color=INK, linewidth=3.2, solid_joinstyle="miter")
    axis.plot([-0.7, 0.74], [0.42, 0.42], color=ORANGE, linewidth=5, dashes=(1.6, 1))
    # An angle that rises and settles: a damped oscillation about 1.
    time = np.linspace(0, 1, 161)
    angle = 1 - np.exp(-4.5 * time) * (np.cos(13 * time) + 4.5 / 13 * np.sin(13 * time))
    axis.plot(-0.7 + 1.44 * time, -0.7 + 1.12 * angle, color=BLUE, linewidth=6, solid_capstyle="round")
    axis.add_patch(Polygon(_cam(0.3, -0.24, 0.29), facecolor=GREEN, **EDGE))
    return figure


def _card() -> tuple[Figure, Axes]:
    """A figure and its axes, -1 to 1 both ways, with a white card."""
    figure = Figure(figsize=(2, 2), facecolor="none")
    axis = figure.add_axes((0, 0, 1, 1))
    axis.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal")
    axis.axis("off")
    card: dict[str, Any] = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": INK, "linewidth": 2}
    axis.add_patch(FancyBboxPatch((-0.86, -0.86), 1.72, 1.72, **card))
    return figure, axis


def _cam(x: float, y: float, size: float) -> Array:
    """A wheel with four lobes, viewed along its shaft."""
    angle = np.linspace(0, 2 * np.pi, 161)
    radius = size + 0.055 * np.cos(4 * angle)
    return np.column_stack([x + radius * np.sin(angle), y + radius * np.cos(angle)])
