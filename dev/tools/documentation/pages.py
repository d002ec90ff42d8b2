"""The pages: text from docs/fmu-page/text, tables from the model descriptions, figures from runs of the FMU."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from prw.errors import UserError
from tools.documentation import tables
from tools.documentation.sources import PROGRAMS, SOURCES, read, read_description, read_table

#: Table 1 as the paper prints it.
PRINTED = Path("modelDescription/parameters.json")


@dataclass(frozen=True)
class Page:
    """The page of an FMU: the directory of its text within SOURCES/text, and the directory of the files that are copied
    into the FMU."""

    text: str
    content: Path

    @property
    def path(self) -> Path:
        """The page within the project."""
        return self.content / "documentation" / "index.html"

    @property
    def description(self) -> Path:
        """The model description of its FMU within the project."""
        return self.content / "modelDescription.xml"


TESTBED = Page("testbed", Path("modelDescription"))
CONTROLLER = Page("controller", Path("crates/prw-controller/modelDescription"))
PAGES = (TESTBED, CONTROLLER)


def render(project: Path, page: Page) -> str:
    """The page as HTML. Depends on the project's files only, so that the same files give the same page."""
    import jinja2

    sources = project / SOURCES
    description = read_description(project / page.description)
    printed = json.loads(read(project / PRINTED))
    numbers = json.loads(read(sources / "figures/numbers.json"))
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(sources), undefined=jinja2.StrictUndefined)
    values = {
        "n": numbers,
        "drawing": read(sources / "testbed.svg"),
        "figure": lambda name, meaning: _figure(sources / "figures" / f"{name}.svg", meaning),
        "program": lambda name: _program(name, read(project / PROGRAMS / f"{name}.py")),
        "table_of": lambda path, heading: tables.text_table(read_table(project / path, heading)),
        "variable_table": lambda causality, title: tables.variable_table(description, causality, title),
        "parameter_table": lambda: tables.parameter_table(description, {}),
        "parameter_table_as_printed": lambda: tables.parameter_table(description, printed),
        "order_table": lambda: tables.order_table(numbers),
        "minus": _minus,
        "poles": {mode: _roots(numbers["poles"][mode]) for mode in ("pitch", "roll")},
        "zeros": _roots(list(reversed(numbers["zeros"]))),
        "identifier": html.escape(description.coSimulation.modelIdentifier),
        "description": html.escape(description.description),
    }
    try:
        (_, title, lead), *sections = [
            _section(environment, path, values) for path in _in_order(sources / "text" / page.text)
        ]
        return environment.get_template("page.html").render(
            style=read(sources / "style.css"),
            title=title,
            lead=lead,
            version=html.escape(description.version),
            license=html.escape(description.license),
            sections=sections,
        )
    except jinja2.TemplateError as error:
        raise UserError(f"{getattr(error, 'filename', None) or sources}: {error.message}") from None


def _in_order(directory: Path) -> list[Path]:
    """The files N_NAME.html, in the order of their numbers N."""
    paths = sorted(directory.glob("*_*.html"), key=lambda path: int(path.stem.split("_")[0]))
    if not paths:
        raise UserError(f"{directory}: there are no files N_NAME.html; run this in the repository root")
    return paths


def _section(environment: Any, path: Path, values: dict[str, Any]) -> tuple[str, str, str]:
    """A file's anchor, its title, which is a comment in its first line, and its text."""
    title = re.match(r"\{# title: (.*) #\}\n", read(path))
    if not title:
        raise UserError(f"{path}: the first line must be {{# title: ... #}}")
    text = environment.get_template(f"text/{path.parent.name}/{path.name}").render(values)
    return path.stem.split("_", 1)[1], html.escape(title[1]), typeset(text).strip()


def _figure(path: Path, meaning: str) -> str:
    """A figure's SVG for the page, with a description."""
    if not path.is_file():
        raise UserError(f"{path}: missing; `make figures` makes it")
    start = f'<svg class="plot" role="img" aria-label="{html.escape(meaning)}"'
    return read(path).strip().replace('<svg xmlns="http://www.w3.org/2000/svg"', start, 1)


def _program(name: str, text: str) -> str:
    """A program, which the tests run unchanged."""
    return f'<pre data-run="{name}" tabindex="0"><code>{html.escape(text.strip(), quote=False)}</code></pre>'


def _roots(roots: Iterable[Sequence[float]]) -> str:
    """Real and conjugate complex numbers as text: −174.87 and −9.68 ± 34.68 i."""
    parts = []
    for real, imaginary in roots:
        parts.append(f"{real:.2f}" + (f" ± {imaginary:.2f} i" if imaginary else ""))
    return _minus(" and ".join(parts))


def _minus(number: object) -> str:
    """A number, or text with numbers, with the mathematical minus sign."""
    return str(number).replace("-", "\N{MINUS SIGN}")


def typeset(text: str) -> str:
    r"""Formulas as MathML; \tag{8} between \[ \] puts the paper's number next to the equation."""
    try:
        from latex2mathml.converter import convert
    except ImportError:
        raise UserError("the package latex2mathml is missing; `make docs` installs it") from None

    def inline(match: re.Match[str]) -> str:
        return _tidy(convert(html.unescape(match[1]), display="inline"))

    def block(match: re.Match[str]) -> str:
        tag = re.search(r"\\tag\{(.*?)\}", match[1])
        formula = _tidy(convert(re.sub(r"\\tag\{.*?\}", "", match[1]).strip(), display="block"))
        number = f'<span class="number">({tag[1]})</span>' if tag else ""
        return f'<div class="equation" tabindex="0">{formula}{number}</div>'

    return re.sub(r"\\\((.+?)\\\)", inline, re.sub(r"\\\[(.+?)\\\]", block, text, flags=re.S), flags=re.S)


def _tidy(mathml: str) -> str:
    """Remove parts that HTML does not need. Matrices get brackets from the style sheet, because characters for brackets
    grow with the matrix only in a font for mathematics."""
    mathml = mathml.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', "")
    special = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
    mathml = re.sub(r"&#x([0-9A-Fa-f]+);", lambda m: special.get(chr(int(m[1], 16)), chr(int(m[1], 16))), mathml)
    return re.sub(r"<mo>\[</mo><mtable>(.*?)</mtable><mo>\]</mo>", r'<mtable class="matrix">\1</mtable>', mathml)
