"""The fit report as one HTML page that needs nothing beside it."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib
import numpy as np
from jinja2 import Environment, PackageLoader
from markupsafe import Markup
from matplotlib.figure import Figure

from prw.channels import si_unit
from prw.identification.experiment import Experiment
from prw.identification.fit import Solution
from prw.identification.model import Parameters
from prw.motion import Array
from prw.plots import BLUE, PAGE_STYLE, VERMILION, envelope

#: Stands in figures for the page's text colour, which depends on light or dark, as those of the curves do.
INK = "#010203"
COLOURS = {INK: "currentColor", BLUE.lower(): "var(--blue)", VERMILION.lower(): "var(--red)"}
FIGURE_STYLE = {
    **PAGE_STYLE,
    **dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), INK),
    "axes.grid": False,
    "lines.linewidth": 1.0,
    "font.size": 8.5,
    "svg.fonttype": "none",
}
#: Time intervals in which a curve is drawn by its extremes; about one for each point on the screen.
INTERVALS = 500
#: Shown in these units: more telling than radians.
SHOWN = {"rad": ("deg", np.degrees(1.0)), "rad/s": ("deg/s", np.degrees(1.0))}
#: Seconds of the close-up.
CLOSE = 1.0
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def page(
    known: Parameters,
    experiments: Sequence[Experiment],
    solution: Solution,
    residuals: Sequence[Array],
    channels: Sequence[Mapping[str, Any]],
    estimates: Mapping[str, Any],
    **shown: Any,
) -> str:
    """The page as text. residuals: (s, c) of each experiment. channels: the fields of each ChannelFit. estimates: by
    name. shown: what the template takes besides."""
    environment = Environment(
        loader=PackageLoader("prw.identification", "."), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(digits=_digits, percent=_percent, shade=_shade)
    rows = []
    for name, parameter in known.real.items():
        rows.append(
            {
                "name": name,
                "meaning": parameter.meaning.split(";")[0],
                "factor": parameter.factor,
                "unit": parameter.shown,
                "start": solution.task.start[name],
                "found": estimates.get(name),
            }
        )
    return environment.get_template("report.html.j2").render(
        solution=solution,
        rows=rows,
        channels=[_shown(channel) for channel in channels],
        figures=figures(experiments, solution, residuals),
        **shown,
    )


def figures(experiments: Sequence[Experiment], solution: Solution, residuals: Sequence[Array]) -> list[dict[str, str]]:
    """A figure for every channel of every experiment: a close-up of measured and modelled, and the residual."""
    drawn = []
    with matplotlib.rc_context(FIGURE_STYLE):
        figure = _Curves()
        for experiment, residual, modelled in zip(experiments, residuals, solution.modelled):
            for j, name in enumerate(experiment.channels):
                unit, factor = SHOWN.get(si_unit(name), (si_unit(name), 1.0))
                keep = np.isfinite(residual[:, j])
                curves = factor * modelled[keep, j], factor * residual[keep, j]
                svg = figure.svg(experiment.sampled[keep], *curves, unit.replace("N.m", "N m"))
                title = f"{experiment.name}: {name}" if len(experiments) > 1 else name
                drawn.append({"title": title, "svg": Markup(svg)})
    return drawn


class _Curves:
    """A figure that is drawn again and again with other curves, which takes half the time of a new one."""

    def __init__(self) -> None:
        # Margins by hand: to find them, matplotlib draws everything twice.
        self._figure = Figure(figsize=(6.4, 3.6))
        self._figure.subplots_adjust(left=0.12, right=0.985, top=0.93, bottom=0.115, hspace=0.5)
        self._close, self._all = self._figure.subplots(2)
        self._measured = self._close.plot([], color=BLUE, label="measured")[0]
        self._modelled = self._close.plot([], color=VERMILION, dashes=(4, 2), label="FMU")[0]
        self._residual = self._all.plot([], color=BLUE, linewidth=0.7)[0]
        self._close.legend(loc="lower right", bbox_to_anchor=(1, 0.98), ncols=2, borderaxespad=0)
        self._close.set_title("measured and modelled, the liveliest second")
        self._all.set(title="residual, all of it", xlabel="time (s)")
        for axes in (self._close, self._all):
            axes.locator_params(axis="y", nbins=4)

    def svg(self, time: Array, modelled: Array, residual: Array, unit: str) -> str:
        """The curves (n,) at the times (n,) s as SVG that takes its colours from the page."""
        measured = modelled + residual
        # The liveliest second, where measured and modelled can be told apart.
        centre = time[np.argmax(np.abs(measured - measured.mean()))]
        part = (time >= centre - CLOSE / 2) & (time <= centre + CLOSE / 2)
        self._measured.set_data(*envelope(time[part], measured[part], INTERVALS))
        self._modelled.set_data(*envelope(time[part], modelled[part], INTERVALS))
        self._residual.set_data(*envelope(time, residual, INTERVALS))
        for axes, span in ((self._close, time[part]), (self._all, time)):
            axes.relim()
            axes.autoscale_view(scalex=False)
            axes.set(xlim=(span[0], span[-1]), ylabel=unit)
        text = io.StringIO()
        self._figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
        svg = text.getvalue()
        svg = svg[svg.index("<svg") :]
        for drawn, shown in COLOURS.items():
            svg = svg.replace(drawn, shown)
        return re.sub(r'width="[\d.]+pt" height="[\d.]+pt"', 'role="img"', svg, count=1)


def _shown(channel: Mapping[str, Any]) -> dict[str, Any]:
    unit, factor = SHOWN.get(channel["unit"], (channel["unit"], 1.0))
    scaled = {name: channel[name] * factor for name in ("noise", "residual", "offset")}
    return {**channel, **scaled, "unit": unit}


def _digits(value: float, count: int = 4) -> str:
    """A number with `count` significant digits."""
    text = f"{value:.{count}g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(RAISED)}"
    return text.replace("-", "−")


def _percent(value: float | None) -> str:
    if value is None:
        return "at rest"
    if not np.isfinite(value) or abs(value) > 10:
        return "> 1000 %"
    return f"{100 * value:.{1 if abs(value) >= 0.1 else 2 if abs(value) >= 0.001 else 3}f} %".replace("-", "−")


def _shade(value: float) -> str:
    """Background of a correlation: blue for positive, vermilion for negative, as strong as it is."""
    colour = "0 114 178" if value > 0 else "213 94 0"
    return f"rgb({colour} / {0.75 * abs(value):.2f})"
