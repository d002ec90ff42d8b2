"""Writes docs/performance.md from the results of `make bench`."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tools.documentation.sources import read

PAGE = Path("docs/performance.md")
RATIOS = Path("dev/benches/ratios.json")
TEMPLATE = "performance.md.j2"


def render(project: Path) -> str:
    """The page in Markdown. Depends on the project's files only. Raises UserError if the file with the numbers is missing."""
    import jinja2

    ratios = json.loads(read(project / RATIOS))
    loader = jinja2.FileSystemLoader(Path(__file__).parent)
    runs = [[_number(pick(row[i] for row in ratios["runs"].values())) for pick in (min, max)] for i in (0, 4)]
    environment = jinja2.Environment(loader=loader, undefined=jinja2.StrictUndefined, keep_trailing_newline=True)
    return environment.get_template(TEMPLATE).render(
        step=_number(*ratios["steps"]["angles set, step, 4 outputs, as vectors"]),
        sizes=_number(*ratios["others"]["four alternating sizes / steps of one size"]),
        loop=runs[0],
        fmpy=runs[1],
        table=lambda name, *header: _table(header, ratios[name].items()),
    )


def _table(header: tuple[str, ...], rows: Iterable[tuple[str, list[Any]]]) -> str:
    lines = [f"| {' | '.join(header)} |", "|" + "---|" * len(header)]
    lines += [f"| {label} | {' | '.join(map(_number, figures))} |" for label, figures in rows]
    return "\n".join(lines)


def _number(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:,.3g}" if value < 1000 else f"{value:,.0f}"
