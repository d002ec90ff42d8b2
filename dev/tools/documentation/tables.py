"""Tables as HTML. The style sheet shows a row as a paragraph in narrow windows."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence
from typing import Any

from tools.documentation.sources import Table, format_start, shown_unit

#: Labels of the outputs in the table of orders.
OUTPUT_NAMES = {
    "pitch": "pitch",
    "roll": "roll",
    "pitch_rate": "pitch rate",
    "roll_rate": "roll rate",
    "tau1": "torque",
}


def variable_table(description: Any, causality: str, title: str) -> str:
    """Name, unit and meaning of the variables of a causality, in the order of the model description."""
    rows = []
    for variable in description.modelVariables:
        if variable.causality == causality:
            rows.append(
                f"<tr><td><code>{html.escape(variable.name)}</code></td><td>{_pretty(shown_unit(variable))}</td>"
                f'<td class="meaning">{html.escape(variable.description)}</td></tr>'
            )
    return _table(title, ("name", "unit", "meaning"), rows, kind="rows")


def parameter_table(description: Any, printed: dict[str, Any]) -> str:
    """The parameters with their start values and, unless `printed` is empty, the values and units that the paper prints."""
    rows = []
    for variable in description.modelVariables:
        if variable.causality != "parameter":
            continue
        cells = [
            f"<td><code>{html.escape(variable.name)}</code></td>",
            f'<td class="number">{format_start(variable)}</td>',
            f"<td>{_pretty(shown_unit(variable))}</td>",
            f'<td class="meaning">{html.escape(variable.description)}</td>',
        ]
        if printed:
            paper = printed.get(variable.name)
            text = f"{paper['value']:.8g} {_pretty(paper['unit'])}".strip() if paper else ""
            label = ' data-label="printed:"' if text else ""
            cells.insert(3, f'<td class="number"{label}>{text}</td>')
        rows.append(f"<tr>{''.join(cells)}</tr>")
    header = ("name", "start", "unit", *(("as printed",) if printed else ()), "meaning")
    return _table("", header, rows, numbers=(1, 3) if printed else (1,), kind="rows")


def order_table(numbers: dict[str, Any]) -> str:
    """Orders of convergence, and the error at a step of 1 ms."""
    rows = []
    for name, label in OUTPUT_NAMES.items():
        orders = f"{numbers['order_angles'][name]:.2f}", f"{numbers['order_rates'][name]:.2f}"
        cells = (*orders, str(numbers["error_1ms_percent"][name]))
        rows.append(f"<tr><td>{label}</td>" + "".join(f'<td class="number">{cell}</td>' for cell in cells) + "</tr>")
    header = ("output", "order, angles only", "order, use_omega", "error at 1 ms (%)")
    return _table("", header, rows, numbers=(1, 2, 3))


def text_table(table: Table) -> str:
    """A table from Markdown; formulas stay as they are."""
    rows = []
    for row in table.rows:
        labels = ["", *(f' data-label="{html.escape(head)}:"' for head in table.header[1:])]
        cells = (f"<td{label if cell else ''}>{_inline(cell)}</td>" for label, cell in zip(labels, row))
        rows.append(f"<tr>{''.join(cells)}</tr>")
    return _table("", [html.escape(head) for head in table.header], rows, kind="rows text")


def _inline(text: str) -> str:
    text = re.sub(r"\[([^\]]+)\]\([^)]*\)", r"\1", text)  # the FMU does not contain the targets of links
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(text, quote=False))


def _table(title: str, header: Sequence[str], rows: Iterable[str], numbers: Sequence[int] = (), kind: str = "") -> str:
    """A table in HTML. numbers: indices of the columns with right-aligned numbers. kind: its CSS class."""
    attributes = (' class="number"' if column in numbers else "" for column in range(len(header)))
    head = "".join(f"<th{attribute}>{title}</th>" for attribute, title in zip(attributes, header))
    heading = f"<h3>{title}</h3>\n" if title else ""
    body = "\n".join(rows)
    attribute = f' class="{kind}"' if kind else ""
    parts = f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>"
    return f'{heading}<div class="scroll" tabindex="0"><table{attribute}>\n{parts}\n</table></div>'


def _pretty(unit: str) -> str:
    """kg.m2 as kg m²."""
    narrow = "\N{NARROW NO-BREAK SPACE}"
    return html.escape("" if unit == "1" else unit.replace(".", narrow).replace("s2", "s²").replace("m2", "m²"))
