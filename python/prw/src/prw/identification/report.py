"""The fit report as one HTML page that loads no other file."""

from __future__ import annotations

import io
import re

import matplotlib
import numpy as np
from jinja2 import Environment, PackageLoader
from markupsafe import Markup
from matplotlib.figure import Figure

from prw.columns import si_unit
from prw.identification.findings import ChannelFit, Findings
from prw.identification.rounding import rounded
from prw.motion import Array
from prw.plots import BLUE, PAGE_STYLE, VERMILION, envelope

#: Size of a figure, inches.
SIZE = (6.7, 3.75)
#: The page's colours by matplotlib's.
COLOURS = {
    "#000000": "currentColor",
    BLUE.lower(): "var(--blue)",
    VERMILION.lower(): "var(--red)",
    "#e6e6e6": "var(--line)",
}
#: Time intervals in which a curve is drawn by its extremes; about one per screen pixel.
INTERVALS = 500
#: Units of the figures.
SHOWN = {"rad": ("deg", np.degrees(1.0)), "rad/s": ("deg/s", np.degrees(1.0))}
#: Seconds of the close-up.
CLOSE = 1.0
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def page(found: Findings) -> str:
    """The page as HTML."""
    environment = Environment(
        loader=PackageLoader("prw.identification", "."), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(digits=_digits, percent=_percent, shade=_shade, raised=_raised, prose=_prose)
    return environment.get_template("report.html.j2").render(
        found=found,
        sure=found.sure,
        solution=found.solution,
        estimates=found.parameters,
        notes=found.notes_in(shown=True),
        rounded=rounded,
        channels=[_shown(channel) for channel in found.channels],
        figures=figures(found),
    )


def figures(found: Findings) -> list[dict[str, str]]:
    """A figure for every channel of every experiment: a close-up of measured and modelled, and the residual."""
    drawn = []
    for i, (experiment, modelled) in enumerate(zip(found.experiments, found.solution.modelled)):
        residual = found.residual(i)
        for j, name in enumerate(experiment.channels):
            unit, factor = SHOWN.get(si_unit(name), (si_unit(name), 1.0))
            keep = np.isfinite(residual[:, j])
            svg = _curves(experiment.sampled[keep], factor * modelled[keep, j], factor * residual[keep, j], unit)
            title = f"{experiment.name}: {name}" if len(found.experiments) > 1 else name
            drawn.append({"title": title, "svg": Markup(svg)})
    return drawn


def _curves(time: Array, modelled: Array, residual: Array, unit: str) -> str:
    """Measured and modelled (n,), close by, and the residual (n,) at the times (n,) s, as SVG with the page's colours."""
    measured, unit = modelled + residual, unit.replace("N.m", "N m")
    # The second with the largest values shows the difference of measured and modelled best.
    centre = time[np.argmax(np.abs(measured - measured.mean()))]
    part = (time >= centre - CLOSE / 2) & (time <= centre + CLOSE / 2)
    with matplotlib.rc_context({**PAGE_STYLE, "font.family": "sans-serif"}):
        figure = Figure(figsize=SIZE, layout="constrained")
        close, whole = figure.subplots(2)
        close.plot(*envelope(time[part], measured[part], INTERVALS), color=BLUE, label="measured")
        close.plot(*envelope(time[part], modelled[part], INTERVALS), color=VERMILION, dashes=(4, 2), label="FMU")
        close.legend(loc="lower right", bbox_to_anchor=(1, 0.97), ncols=2, borderaxespad=0)
        whole.plot(*envelope(time, residual, INTERVALS), color=BLUE)
        for axis, title in ((close, "measured and modelled, the liveliest second"), (whole, "residual, all of it")):
            axis.set(title=title, ylabel=unit)
            axis.margins(x=0)
        whole.set_xlabel("time (s)")
        file = io.StringIO()
        figure.savefig(
            file, format="svg", transparent=True, metadata=dict.fromkeys(("Creator", "Date", "Format", "Type"))
        )
    # Two decimals of a point are enough.
    svg = re.sub(r"(\.\d\d)\d+", r"\1", file.getvalue().partition("<svg ")[2])
    for colour, name in COLOURS.items():
        svg = svg.replace(colour, name)
    return f'<svg role="img" fill="currentColor" {svg}'


def _shown(channel: ChannelFit) -> ChannelFit:
    unit, factor = SHOWN.get(channel.unit, (channel.unit, 1.0))
    scaled = {name: getattr(channel, name) * factor for name in ("noise", "residual", "offset")}
    return channel._replace(unit=unit, **scaled)


def _digits(value: float, count: int = 4) -> str:
    """A number with `count` significant digits."""
    return _raised(f"{value:.{count}g}")


def _prose(text: str) -> Markup:
    """A message of the command line: code in backticks as code, and signs and units as printed."""
    parts = text.replace("+-", "±").replace("N.m", "N·m").split("`")
    return Markup("").join(Markup("<code>{}</code>").format(part) if k % 2 else part for k, part in enumerate(parts))


def _raised(number: str) -> str:
    """A number with a true minus sign, and its exponent raised."""
    if "e" in number:
        mantissa, exponent = number.split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(RAISED)}"
    return number.replace("-", "−")


def _percent(value: float | None) -> str:
    if value is None:
        return "at rest"
    if not np.isfinite(value) or abs(value) > 10:
        return "> 1000 %"
    return f"{100 * value:.{1 if abs(value) >= 0.1 else 2 if abs(value) >= 0.001 else 3}f} %".replace("-", "−")


def _shade(value: float) -> str:
    """Background of a correlation: blue for positive, vermilion for negative, opaque by its magnitude."""
    colour = "0 114 178" if value > 0 else "213 94 0"
    return f"rgb({colour} / {0.75 * abs(value):.2f})"
