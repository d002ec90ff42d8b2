"""The block icon: a roller-carrier at either side, the lobed cam between them, and the load on its shaft."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyBboxPatch, Polygon

INK, BLUE, GREEN, GREY, ORANGE = "#1c2126", "#2f8fd0", "#27a17c", "#c9ced3", "#d55e00"
EDGE = {"edgecolor": INK, "linewidth": 2.2, "joinstyle": "round"}


def draw_icon() -> Figure:
    """A square figure of two inches, on white so that it shows on any canvas; clear at 64 pixels."""
    figure = Figure(figsize=(2, 2), facecolor="none")
    axis = figure.add_axes((0, 0, 1, 1))
    axis.set(xlim=(-1, 1), ylim=(-1, 1), aspect="equal")
    axis.axis("off")
    card = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": INK, "linewidth": 2}
    axis.add_patch(FancyBboxPatch((-0.86, -0.86), 1.72, 1.72, **card))
    line = {"color": INK, "linewidth": 5, "solid_capstyle": "butt"}
    axis.plot([-0.95, -0.5], [-0.28, -0.28], **line)
    axis.plot([0.5, 0.95], [-0.28, -0.28], **line)
    axis.plot([0, 0], [0.1, 0.5], **line)
    for side in (-1, 1):
        # The carrier, and its rollers towards the cam.
        carrier = [(side * 0.62, 0.2), (side * 0.46, 0.2), (side * 0.46, -0.76), (side * 0.62, -0.76)]
        axis.add_patch(Polygon(carrier, facecolor=BLUE, **EDGE))
        for height in (0.06, -0.28, -0.62):
            axis.add_patch(Circle((side * 0.35, height), 0.105, facecolor=GREY, **EDGE))
    axis.add_patch(Polygon(_cam(), facecolor=GREEN, **EDGE))
    # Gripper.
    right = [(0.2, 0.44), (0.28, 0.88), (0.15, 0.88), (0.09, 0.58)]
    left = [(-x, y) for x, y in reversed(right)]
    axis.add_patch(Polygon(right + left, facecolor=ORANGE, **EDGE))
    return figure


def _cam():
    """A wheel with four lobes, seen along its shaft."""
    angle = np.linspace(0, 2 * np.pi, 161)
    radius = 0.29 + 0.055 * np.cos(4 * angle)
    return np.column_stack([radius * np.sin(angle), -0.28 + radius * np.cos(angle)])
