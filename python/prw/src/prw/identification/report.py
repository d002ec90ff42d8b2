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
#: CSS colour of the page for each colour that matplotlib writes.
COLOURS = {
    "#000000": "currentColor",
    BLUE.lower(): "var(--blue)",
    VERMILION.lower(): "var(--red)",
    "#e6e6e6": "var(--line)",
}
#: Number of intervals of a curve, about one per screen pixel. Only the extremes in each are drawn, which keeps the page small.
INTERVALS = 500
#: For each SI unit that the page replaces, the unit that it shows, and the factor from SI to that unit.
SHOWN = {"rad": ("deg", np.degrees(1.0)), "rad/s": ("deg/s", np.degrees(1.0))}
#: Duration of the close-up, s.
CLOSE = 1.0
#: Superscript characters, for exponents.
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def page(found: Findings, *, command: bool = False) -> str:
    """The page as HTML. command: whether remedies are options of the command instead of arguments of Python."""
    environment = Environment(
        loader=PackageLoader("prw.identification", "."), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters.update(digits=_digits, percent=_percent, shade=_shade, raised=_raised, prose=_prose)
    return environment.get_template("report.html.j2").render(
        found=found,
        sure=found.sure,
        solution=found.solution,
        estimates=found.parameters,
        diagnosis=found.diagnosis_in(command=command),
        notes=found.notes,
        rounded=rounded,
        channels=[_shown(channel) for channel in found.channels],
        figures=figures(found),
    )


def figures(found: Findings) -> list[dict[str, str]]:
    """Draws each channel of each experiment: a close-up of the measured and the modelled values, and the whole residual."""
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
    """Draws one second of the measured and the modelled values and the whole residual, (n,) each at the times (n,) s, as SVG."""
    measured, unit = modelled + residual, unit.replace("N.m", "N m")
    # The curves usually differ most where the values are largest.
    centre = time[np.argmax(np.abs(measured - measured.mean()))]
    part = (time >= centre - CLOSE / 2) & (time <= centre + CLOSE / 2)
    with matplotlib.rc_context({**PAGE_STYLE, "font.family": "sans-serif"}):
        figure = Figure(figsize=SIZE, layout="constrained")
        close, whole = figure.subplots(2)
        close.plot(*envelope(time[part], measured[part], INTERVALS), color=BLUE, label="measured")
        close.plot(*envelope(time[part], modelled[part], INTERVALS), color=VERMILION, dashes=(4, 2), label="FMU")
        close.legend(loc="lower right", bbox_to_anchor=(1, 0.97), ncols=2, borderaxespad=0)
        whole.plot(*envelope(time, residual, INTERVALS), color=BLUE)
        for axis, title in (
            (close, "measured and modelled, the second with the largest values"),
            (whole, "residual, whole recording"),
        ):
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
    """Converts a message of the command line to HTML: backticks become code, `+-` and `N.m` become ± and N·m."""
    parts = text.replace("+-", "±").replace("N.m", "N·m").split("`")
    return Markup("").join(Markup("<code>{}</code>").format(part) if k % 2 else part for k, part in enumerate(parts))


def _raised(number: str) -> str:
    """Formats a number with a minus sign instead of a hyphen, and with its exponent as a superscript."""
    if "e" in number:
        mantissa, exponent = number.split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(RAISED)}"
    return number.replace("-", "−")


def _percent(value: float | None) -> str:
    """Formats a fraction as a percentage; None, the explained share of a channel that did not move, becomes "at rest"."""
    if value is None:
        return "at rest"
    if not np.isfinite(value) or abs(value) > 10:
        return "> 1000 %"
    return f"{100 * value:.{1 if abs(value) >= 0.1 else 2 if abs(value) >= 0.001 else 3}f} %".replace("-", "−")


def _shade(value: float) -> str:
    """Background colour of a correlation: blue if positive, vermilion if negative; the larger the magnitude, the more opaque."""
    colour = "0 114 178" if value > 0 else "213 94 0"
    return f"rgb({colour} / {0.75 * abs(value):.2f})"
