"""Sources of the documentation: files of the repository, and tables in Markdown."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

from prw.errors import UserError

#: Relative to the root of the repository: the sources of the pages, and the model descriptions of testbed and controller.
SOURCES = Path("docs/fmu-page")
TESTBED = Path("modelDescription/modelDescription.xml")
CONTROLLER = Path("examples/controller") / TESTBED


class Table(NamedTuple):
    """The cells of a table as they are written; `header` has the cells of the first row."""

    header: list[str]
    rows: list[list[str]]


def read(path: Path) -> str:
    """The content of a text file. Raises UserError."""
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror}); run this in the repository root") from None


def read_description(path: Path) -> Any:
    """FMPy's model description. Raises UserError."""
    from fmpy import read_model_description

    read(path)
    try:
        return read_model_description(str(path))
    except Exception as error:  # FMPy raises bare Exceptions
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise UserError(f"{path}: no model description ({reason}); `make docs` writes it again") from None


def read_table(path: Path, heading: str) -> Table:
    """The first table below a heading of a Markdown file. Raises UserError if there is none, or if a row has fewer or more cells
    than the header."""
    text = read(path)
    section = re.search(rf"^(#+) {re.escape(heading)}\n(.*?)(?=^#+ |\Z)", text, flags=re.M | re.S)
    table = section and re.search(r"^\|.*\|\n\|[-:| ]+\|\n(?:\|.*\|\n)+", section[2], flags=re.M)
    if not table:
        raise UserError(f"{path}: there is no table below a heading “{heading}”")
    header, _, *rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in table[0].splitlines()]
    for row in rows:
        if len(row) != len(header):
            raise UserError(f"{path}: below “{heading}” the row of “{row[0]}” has {len(row)} cells, not {len(header)}")
    return Table(header, rows)
