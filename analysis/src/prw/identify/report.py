"""The fit report as one HTML page that needs nothing beside it."""

from __future__ import annotations

import io
import re
from typing import List

import matplotlib
import numpy as np
from jinja2 import Environment, PackageLoader
from markupsafe import Markup
from matplotlib.figure import Figure

from prw.channels import si_unit
from prw.identify.results import Findings
from prw.plots import BLUE, PAGE_STYLE, VERMILION, envelope

#: Stands in figures for the page's text colour, which depends on light or dark, as those of the curves do.
INK = "#010203"
COLOURS = {INK: "currentColor", BLUE.lower(): "var(--blue)", VERMILION.lower(): "var(--red)"}
#: Time intervals in which a curve is drawn by its extremes; about one for each point on the screen.
INTERVALS = 500
#: Shown in these units: more telling than radians.
SHOWN = {"rad": ("deg", np.degrees(1.0)), "rad/s": ("deg/s", np.degrees(1.0))}
#: Seconds of the close-up.
CLOSE = 1.0
CORRELATION_LAGS = 200
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def page(findings: Findings) -> str:
    """The page as text."""
    environment = Environment(
        loader=PackageLoader("prw.identify", "."), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters["digits"] = _digits
    environment.filters["percent"] = _percent
    environment.filters["shade"] = _shade
    solution, sure = findings.solution, findings.sure
    rows = []
    for name, parameter in findings.model.parameters.items():
        row = {
            "name": name,
            "meaning": parameter.meaning.split(";")[0],
            "unit": parameter.shown,
            "start": solution.task.start[name] / parameter.factor,
            "value": solution.values[name] / parameter.factor,
            "estimated": name in solution.task.names,
        }
        if row["estimated"]:
            i = solution.task.names.index(name)
            row.update(
                error=row["value"] * sure.relative[i],
                relative=sure.relative[i],
                low=sure.low[i] / parameter.factor,
                high=sure.high[i] / parameter.factor,
                prior=solution.task.priors.get(name),
                change=solution.values[name] / solution.task.start[name] - 1,
            )
        rows.append(row)
    return environment.get_template("report.html.j2").render(
        findings=findings,
        solution=solution,
        sure=sure,
        rows=rows,
        channels=[_shown(channel) for channel in findings.channels()],
        notes=findings.notes(),
        figures=figures(findings),
    )


def figures(findings: Findings) -> List[dict]:
    """A figure for every channel of every experiment: the whole, a close-up, the residual and its autocorrelation."""
    found = []
    for i, experiment in enumerate(findings.experiments):
        residual, modelled = findings.residual(i), findings.solution.evaluation.modelled[i]
        for j, name in enumerate(experiment.channels):
            unit, factor = SHOWN.get(si_unit(name), (si_unit(name), 1.0))
            keep = np.isfinite(experiment.values[:, j])
            columns = (experiment.values[keep, j], modelled[keep, j], residual[keep, j])
            drawn = _figure(experiment.time[keep], *(factor * column for column in columns), unit.replace("N.m", "N m"))
            title = f"{experiment.name}: {name}" if len(findings.experiments) > 1 else name
            found.append({"title": title, "svg": Markup(drawn)})
    return found


def _figure(time: np.ndarray, measured: np.ndarray, modelled: np.ndarray, residual: np.ndarray, unit: str) -> str:
    style = {
        **PAGE_STYLE,
        **{key: INK for key in ("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color")},
        "axes.grid": False,
        "lines.linewidth": 1.0,
        "font.size": 8.5,
        "svg.fonttype": "none",
    }
    with matplotlib.rc_context(style):
        # Margins by hand: to find them, matplotlib draws everything twice.
        figure = Figure(figsize=(6.4, 4.6))
        figure.subplots_adjust(left=0.12, right=0.985, top=0.945, bottom=0.09, hspace=0.55, wspace=0.24)
        axes = figure.subplot_mosaic([["all", "all"], ["close", "correlation"], ["residual", "residual"]])
        # The liveliest second, where measured and modelled can be told apart.
        centre = time[np.argmax(np.abs(measured - measured.mean()))]
        close = (time >= centre - CLOSE / 2) & (time <= centre + CLOSE / 2)
        for panel, part in (("all", slice(None)), ("close", close)):
            axes[panel].plot(*envelope(time[part], measured[part], INTERVALS), color=BLUE, label="measured")
            axes[panel].plot(
                *envelope(time[part], modelled[part], INTERVALS), color=VERMILION, dashes=(4, 2), label="FMU"
            )
            axes[panel].set_ylabel(unit)
        axes["all"].legend(loc="lower right", bbox_to_anchor=(1, 0.98), ncols=2, borderaxespad=0)
        axes["all"].set_title("measured and modelled")
        axes["close"].set_title("close-up")
        axes["residual"].plot(*envelope(time, residual, INTERVALS), color=BLUE, linewidth=0.7)
        axes["residual"].set_title("residual")
        axes["residual"].set_ylabel(unit)
        axes["residual"].set_xlabel("time (s)")
        lags, correlation = _autocorrelation(residual)
        chance = 2 / np.sqrt(len(residual))
        axes["correlation"].axhspan(-chance, chance, color=BLUE, alpha=0.2, linewidth=0)
        axes["correlation"].plot(lags, correlation, color=BLUE)
        axes["correlation"].set_title("residual's autocorrelation (samples)")
        axes["correlation"].set_ylim(-0.3, 1.05)
        for panel in ("all", "residual"):
            axes[panel].set_xlim(time[0], time[-1])
        text = io.StringIO()
        figure.savefig(text, format="svg", transparent=True, metadata={"Date": None})
    svg = text.getvalue()
    svg = svg[svg.index("<svg") :]
    for drawn, shown in COLOURS.items():
        svg = svg.replace(drawn, shown)
    return re.sub(r'width="[\d.]+pt" height="[\d.]+pt"', 'role="img"', svg, count=1)


def _autocorrelation(residual: np.ndarray) -> tuple:
    """Lags (k,) and normalised autocorrelation (k,)."""
    centred = residual - residual.mean()
    size = 1 << int(np.ceil(np.log2(2 * len(centred))))
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    lags = min(CORRELATION_LAGS, len(centred) // 2)
    covariance = np.fft.irfft(spectrum, size)[:lags]
    return np.arange(lags), covariance / max(covariance[0], 1e-300)


def _shown(channel) -> dict:
    unit, factor = SHOWN.get(channel.unit, (channel.unit, 1.0))
    scaled = {name: getattr(channel, name) * factor for name in ("noise", "residual", "offset")}
    return {**channel._asdict(), **scaled, "unit": unit}


def _digits(value: float, count: int = 4) -> str:
    """A number with `count` significant digits."""
    text = f"{value:.{count}g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(RAISED)}"
    return text.replace("-", "−")


def _percent(value: float) -> str:
    if not np.isfinite(value) or abs(value) > 10:
        return "> 1000 %"
    return f"{100 * value:.{1 if abs(value) >= 0.1 else 2 if abs(value) >= 0.001 else 3}f} %".replace("-", "−")


def _shade(value: float) -> str:
    """Background of a correlation: blue for positive, vermilion for negative, as strong as it is."""
    colour = "0 114 178" if value > 0 else "213 94 0"
    return f"rgb({colour} / {0.75 * abs(value):.2f})"
