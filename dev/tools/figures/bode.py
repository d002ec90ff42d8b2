"""Bode plots: the curve of the linear model, and points measured by stepped sines."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from matplotlib.ticker import LogLocator, MaxNLocator, MultipleLocator

from prw.plots import BLUE, VERMILION
from prw.testbed import ANGLE_OF
from tools.figures.results import CURVE, POINTS, Results
from tools.frequency import SHAFTS, TORQUES, decibels, degrees

#: Possible distances between the ticks of a phase, degrees; the smallest with at most five intervals is used.
PHASE_STEPS = (10, 15, 30, 45, 90, 180, 360)
SUBSCRIPTS = "₀₁₂₃₄₅₆₇₈₉"


class Transfer(NamedTuple):
    """One Bode plot.

    Attributes
    ----------
    key
        Letter of the plot in file names; for H(s) also in Fig. 5.
    title
        Input and output.
    unit
        Unit of 0 dB.
    curve
        Complex response of the linear model at the frequencies CURVE.
    points
        Complex response that was measured at the frequencies POINTS.
    """

    key: str
    title: str
    unit: str
    curve: np.ndarray
    points: np.ndarray


def transfers(found: Results) -> tuple[list[Transfer], list[Transfer]]:
    """The eight plots of H(s), Fig. 5 (a) to (h), and the four of G(s) from motor angles to torques."""
    response = found.model.response_at_hz(CURVE, ANGLE_OF)
    points = found.sweep

    def make(key: str, symbol: str, row: int, motor: int, unit: str) -> Transfer:
        output = found.model.outputs[row]
        greek = {"theta": "θ", "tau": "τ"}[output.rstrip("0123456789")] + SUBSCRIPTS[int(output[-1])]
        title = f"({key}) {symbol}  θ{SUBSCRIPTS[motor + 1]} → {greek}"
        return Transfer(key, title, unit, response[:, row, motor], points[:, row, motor])

    shafts = [
        make("abcdefgh"[4 * motor + row], f"H{SUBSCRIPTS[row + 1]}{SUBSCRIPTS[motor + 1]}", row, motor, "1")
        for motor in range(2)
        for row in range(len(SHAFTS))
    ]
    torques = [
        make("ijkl"[2 * motor + row], "", len(SHAFTS) + row, motor, "1 N m/rad")
        for motor in range(2)
        for row in range(len(TORQUES))
    ]
    return shafts, [panel._replace(title=panel.title.replace(f"({panel.key})   ", "")) for panel in torques]


def draw_bode(figure: Any, panel: Transfer) -> None:
    """Draw magnitude and phase, one above the other, into a figure or subfigure."""
    magnitude, phase = figure.subplots(2, sharex=True, height_ratios=[1.25, 1])
    magnitude.set_title(panel.title)
    for axis, convert in ((magnitude, decibels), (phase, degrees)):
        curve, points = convert(panel.curve), convert(panel.points)
        if axis is phase:
            # Both phases are unwrapped, but may differ by full turns.
            points = points + 360 * np.round((curve[0] - points[0]) / 360)
        axis.plot(CURVE, curve, color=BLUE, label="linear model")
        axis.plot(POINTS, points, "o", color=VERMILION, fillstyle="none", markersize=3.6, label="stepped sine")
    magnitude.legend(loc="lower right", bbox_to_anchor=(1, 0.97), ncols=2, borderaxespad=0, columnspacing=1.2)
    magnitude.set_ylabel("dB" if panel.unit == "1" else f"dB re {panel.unit}")
    phase.set_ylabel("phase (deg)")
    phase.set_xlabel("frequency (Hz)")
    phase.set_xscale("log")
    phase.set_xlim(CURVE[0], CURVE[-1])
    phase.xaxis.set_major_locator(LogLocator())
    phase.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    magnitude.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    turned = np.ptp(degrees(panel.curve))
    phase.yaxis.set_major_locator(MultipleLocator(next(step for step in PHASE_STEPS if turned <= 5 * step)))
    figure.align_ylabels([magnitude, phase])
