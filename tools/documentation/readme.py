"""README's tables of variables and errata and its program, which the pages have too, as Markdown."""

from __future__ import annotations

import re
from pathlib import Path

from prw.errors import UserError
from tools.documentation.formulas import plain
from tools.documentation.pages import TESTBED
from tools.documentation.sources import ERRATA, PROGRAMS, read, read_description, read_table, start_of, unit_of

README = Path("README.md")


def renew(project: Path) -> str:
    """README with the text between its comments `<!-- NAME, written by make docs -->` and `<!-- end of NAME -->` made
    anew.

    Raises UserError where such a pair is missing.
    """
    text = read(project / README)
    parts = {
        "variables": _variables(project),
        "errata": _errata(project),
        "program": _program(project),
    }
    for name, part in parts.items():
        first, last = f"<!-- {name}, written by make docs -->\n", f"<!-- end of {name} -->"
        if text.count(first) != 1 or text.count(last) != 1 or text.index(first) > text.index(last):
            raise UserError(f"{project / README}: there must be one line {first.strip()} and after it one {last}")
        text = re.sub(
            f"(?<={re.escape(first)}).*?(?={re.escape(last)})", lambda _, part=part: f"\n{part}\n", text, flags=re.S
        )
    return text


def _variables(project: Path) -> str:
    """Inputs, outputs and parameters."""
    description = read_description(project / TESTBED.description)
    rows = []
    for causality in ("input", "output", "parameter"):
        for variable in description.modelVariables:
            if variable.causality == causality:
                start = start_of(variable) if causality == "parameter" else ""
                rows.append([f"`{variable.name}`", causality, unit_of(variable), start, variable.description])
    return _markdown(["name", "", "unit", "start", "meaning"], rows)


def _errata(project: Path) -> str:
    heads, rows = read_table(project / ERRATA, "What the paper prints, and what holds")
    return _markdown(heads, [[plain(cell) for cell in row] for row in rows])


def _program(project: Path) -> str:
    """The one for FMPy, with the FMU where `make fmu` leaves it."""
    program = read(project / PROGRAMS / "run_in_fmpy.py")
    return "```python\n" + program.replace('"prw_testbed.fmu"', '"target/fmu/prw_testbed.fmu"') + "```\n"


def _markdown(heads: list[str], rows: list[list[str]]) -> str:
    lines = [f"| {' | '.join(cells)} |\n".replace("  ", " ") for cells in (heads, *rows)]
    return "".join([lines[0], "|---" * len(heads) + "|\n", *lines[1:]])
