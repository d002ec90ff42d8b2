"""The validation report as a page, in the style of the documentation. Every number is from a run."""

from __future__ import annotations

import html
import re

from tools.documentation import PROJECT
from tools.documentation.sources import SOURCES, TESTBED, Table, read, read_description
from tools.validation.runs import CHANGE, Row, Validation

LEAD = """<p>Reference experiments, run with the testbed’s FMU in the importers that are installed here, and compared with
a solution that comes from the energies of the testbed’s parts and shares no code with the FMU.</p>
<p><strong>No measured data of the real testbed were available.</strong> This page shows how well the FMU solves the paper’s
equations under these importers. It does not show how well these equations describe the real testbed.</p>"""


def page(found: Validation) -> str:
    """The page as HTML."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(PROJECT / SOURCES), undefined=jinja2.StrictUndefined
    )
    description = read_description(PROJECT / TESTBED)
    sections = [
        ("outcome", "Outcome", outcome(found)),
        ("experiments", "Experiments", experiments(found)),
        ("runs", "Runs", runs(found)),
        ("sensitivity", "Changes that the tolerances detect", sensitivity(found)),
    ]
    return environment.get_template("page.html").render(
        style=read(PROJECT / SOURCES / "style.css"),
        title="Validation of the testbed’s FMU",
        lead=LEAD,
        version=html.escape(description.version),
        license=html.escape(description.license),
        links=[(f"#{name}", title) for name, title, _ in sections],
        sections=sections,
    )


def outcome(found: Validation) -> str:
    """The number of runs that agree, the largest differences, and the date, the machine and the guid."""
    far = [row for row in found.rows if not row.agrees]
    worst = max((row for row in found.rows if row.agrees), key=lambda row: row.share, default=None)
    lines = [f"{len(found.rows) - len(far)} of {len(found.rows)} runs agree with the reference."]
    if worst:
        lines.append(f"The largest difference among them is {worst.share:.0%} of its tolerance: {worst}.")
    lines += [f"Outside of the tolerance: {row}." for row in far]
    if found.absent:
        lines.append(f"Not run, because they are not installed: {', '.join(found.absent)}.")
    lines.append(f"Run on {found.date}, {found.machine}. The FMU of FMI 2.0 has the guid {found.guid}.")
    return "".join(f"<p>{html.escape(line)}</p>" for line in lines)


def experiments(found: Validation) -> str:
    """Names and descriptions."""
    return text_table(Table(["experiment", "description"], [[f"`{n}`", text] for n, text in found.experiments.items()]))


def runs(found: Validation) -> str:
    """A table for each importer."""
    header = ["experiment", "FMI", "angles (rad)", "rates (rad/s)", "torques (N.m)", "of the tolerance", ""]
    text = "<p>Largest differences of any output of a kind, and the largest of all in terms of its tolerance.</p>"
    by_importer: dict[str, list[Row]] = {}
    for row in found.rows:
        by_importer.setdefault(", ".join(filter(None, (row.tool, row.interface))), []).append(row)
    for importer, rows in by_importer.items():
        cells = [
            [
                f"`{row.experiment}`",
                row.fmi,
                *(f"{value:.1e}" for value in row.largest.values()),
                f"{row.share:.1%}",
                "agrees" if row.agrees else "too far",
            ]
            for row in rows
        ]
        text += f"<h3>{html.escape(importer)}</h3>{text_table(Table(header, cells))}"
    return text


def sensitivity(found: Validation) -> str:
    """The effect of a change of each parameter in terms of the tolerance."""
    names = list(next(iter(found.sensitivity.values())))
    rows = [[f"`{name}`", *(f"{shares[p]:.1f}" for p in names)] for name, shares in found.sensitivity.items()]
    return (
        f"<p>Largest difference in terms of its tolerance when one parameter is {CHANGE:.0%} larger, in Co-Simulation under "
        "fmu_run. The experiment detects a change above 1.</p>" + text_table(Table(["experiment", *names], rows))
    )


def text_table(table: Table) -> str:
    """A table whose cells are written in Markdown, in HTML. The style sheet shows a row as a paragraph in narrow windows."""
    rows = []
    for row in table.rows:
        labels = ["", *(f' data-label="{html.escape(head)}:"' for head in table.header[1:])]
        cells = (f"<td{label if cell else ''}>{_inline(cell)}</td>" for label, cell in zip(labels, row))
        rows.append(f"<tr>{''.join(cells)}</tr>")
    head, body = "".join(f"<th>{html.escape(head)}</th>" for head in table.header), "\n".join(rows)
    parts = f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>"
    return f'<div class="scroll" tabindex="0"><table class="rows text">\n{parts}\n</table></div>'


def _inline(text: str) -> str:
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text, quote=False))
