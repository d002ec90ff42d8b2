"""The fit report as one HTML page that loads no other file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from prw.channels import si_unit
from prw.identification.experiment import Experiment
from prw.identification.fit import Solution
from prw.identification.model import Parameters
from prw.motion import Array, envelope

#: Size of a figure, and of the margins left, right, above and below each of its two axes.
WIDTH, HEIGHT, LEFT, RIGHT, ABOVE, BELOW = 640, 180, 66, 10, 26, 30
#: Marks along an axis, at least, and the steps that are round.
MARKS, ROUND = 4, (5.0, 2.0, 1.0)
#: Time intervals in which a curve is drawn by its extremes; about one per screen pixel.
INTERVALS = 500
#: Units of the figures.
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
    """The page as HTML. residuals: (s, c) of each experiment. channels: the fields of each ChannelFit. estimates: by
    name. shown: further variables of the template."""
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
    for experiment, residual, modelled in zip(experiments, residuals, solution.modelled):
        for j, name in enumerate(experiment.channels):
            unit, factor = SHOWN.get(si_unit(name), (si_unit(name), 1.0))
            keep = np.isfinite(residual[:, j])
            svg = _curves(experiment.sampled[keep], factor * modelled[keep, j], factor * residual[keep, j], unit)
            title = f"{experiment.name}: {name}" if len(experiments) > 1 else name
            drawn.append({"title": title, "svg": Markup(svg)})
    return drawn


def _curves(time: Array, modelled: Array, residual: Array, unit: str) -> str:
    """Measured and modelled (n,), close by, and the residual (n,) at the times (n,) s, as SVG with the page's colours."""
    measured, unit = modelled + residual, unit.replace("N.m", "N m")
    # The second with the largest values shows the difference of measured and modelled best.
    centre = time[np.argmax(np.abs(measured - measured.mean()))]
    part = (time >= centre - CLOSE / 2) & (time <= centre + CLOSE / 2)
    close = [("blue", "", measured[part]), ("red", ' stroke-dasharray="5 3"', modelled[part])]
    key = (
        f'<text x="{WIDTH - RIGHT}" y="16" text-anchor="end"><tspan fill="var(--blue)">measured</tspan>'
        ' <tspan fill="var(--red)" dx="8">FMU (dashed)</tspan></text>'
    )
    parts = [
        _axes(0, "measured and modelled, the liveliest second", time[part], close, unit),
        key,
        _axes(HEIGHT, "residual, all of it; time in s", time, [("blue", "", residual)], unit),
    ]
    return (
        f'<svg viewBox="0 0 {WIDTH} {2 * HEIGHT}" role="img" font-size="13" fill="currentColor">{"".join(parts)}</svg>'
    )


def _axes(top: float, title: str, time: Array, curves: Sequence[tuple[str, str, Array]], unit: str) -> str:
    """Curves as (colour, style, values (n,)) over the times (n,), with marks at round values."""
    low, high = (float(end([end(y) for _, _, y in curves])) for end in (np.min, np.max))
    margin = 0.05 * (high - low) or 1.0
    low, high, first, last = low - margin, high + margin, float(time[0]), float(time[-1])
    bottom, height = top + HEIGHT - BELOW, HEIGHT - ABOVE - BELOW
    right, width = WIDTH - RIGHT, WIDTH - LEFT - RIGHT

    def x(t: Array | float) -> Array | float:
        return LEFT + width * (t - first) / ((last - first) or 1.0)

    def y(value: Array | float) -> Array | float:
        return bottom - height * (value - low) / (high - low)

    parts = [
        f'<text x="{LEFT}" y="{top + 16}">{title}</text><text x="4" y="{top + 16}">{unit}</text>',
        f'<path d="M{LEFT} {top + ABOVE}V{bottom}H{right}" fill="none" stroke="currentColor"/>',
    ]
    for mark in _marks(low, high):
        parts.append(f'<text x="{LEFT - 6}" y="{y(mark) + 4:.1f}" text-anchor="end">{_digits(mark)}</text>')
    for mark in _marks(first, last):
        parts.append(f'<text x="{x(mark):.1f}" y="{bottom + 16}" text-anchor="middle">{_digits(mark)}</text>')
    for colour, style, values in curves:
        times, drawn = envelope(time, values, INTERVALS)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(np.asarray(x(times)), np.asarray(y(drawn))))
        parts.append(f'<polyline points="{points}" fill="none" stroke="var(--{colour})"{style}/>')
    return "".join(parts)


def _marks(low: float, high: float) -> list[float]:
    """Round values from `low` to `high`."""
    power = 10.0 ** np.floor(np.log10(high - low)) if high > low else 1.0
    step = next((s * p for p in (power, power / 10) for s in ROUND if (high - low) / (s * p) >= MARKS - 1), power)
    found = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1)
    return [float(value) for value in np.round(found, 12) + 0.0]


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
    """Background of a correlation: blue for positive, vermilion for negative, opaque by its magnitude."""
    colour = "0 114 178" if value > 0 else "213 94 0"
    return f"rgb({colour} / {0.75 * abs(value):.2f})"
