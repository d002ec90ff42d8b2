"""`prw docs`: the page that travels in the FMU, from its text, the model description and the figures."""

from __future__ import annotations

import argparse
import html
import json
import re
from pathlib import Path
from typing import Dict, List, Tuple

from prw.errors import UserError
from prw.files import replacing

PROJECT = Path(".")
#: Within the project: the sources of the page, what its tables come from, and the page.
SOURCES = Path("analysis/documentation")
DESCRIPTION = Path("modelDescription/modelDescription.xml")
PRINTED = Path("modelDescription/parameters.json")
PAGE = Path("modelDescription/documentation/index.html")

#: The outputs in the table of orders, in words.
OUTPUT_NAMES = {
    "pitch": "pitch",
    "roll": "roll",
    "pitch_rate": "pitch rate",
    "roll_rate": "roll rate",
    "tau1": "torque",
}


def add_parser(subparsers) -> None:
    """Add `docs` to prw's subcommands."""
    parser = subparsers.add_parser(
        "docs",
        help="write the FMU's documentation anew",
        description=f"Writes {PAGE} from the text in {SOURCES}, the tables of {DESCRIPTION} and the figures that `prw "
        "figures --commit` has made.",
    )
    parser.add_argument(
        "--project", type=Path, default=PROJECT, metavar="DIR", help="the project's folder (default: %(default)s)"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Carry out `prw docs`. Raises UserError with one line on what is wrong."""
    page = arguments.project / PAGE
    text = render(arguments.project)
    if page.is_file() and page.read_bytes() == text.encode():
        print(f"{page} is up to date")
        return
    with replacing(page) as temporary:
        temporary.write_bytes(text.encode())
    print(f"{page} written, {len(text.encode()) // 1000} kB")


def render(project: Path) -> str:
    """The page as HTML. Depends on the project's files only, so that the same files give the same page."""
    # Loaded when they are needed: FMPy takes a while.
    import jinja2
    from fmpy import read_model_description

    sources = project / SOURCES
    try:
        description = read_model_description(str(project / DESCRIPTION))
        printed = json.loads((project / PRINTED).read_text(encoding="utf-8"))
        numbers = json.loads((sources / "figures/numbers.json").read_text(encoding="utf-8"))
        drawing = (sources / "testbed.svg").read_text(encoding="utf-8")
        style = (sources / "style.css").read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(
            f"{error.filename}: cannot be read ({error.strerror}); run this in the project's folder"
        ) from None

    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(sources), undefined=jinja2.StrictUndefined)
    values = {
        "n": numbers,
        "drawing": drawing,
        "figure": lambda name, meaning: _figure(sources / "figures" / f"{name}.svg", meaning),
        "variable_table": lambda causality, title: _variable_table(description, causality, title),
        "parameter_table": _parameter_table(description, printed),
        "minus": lambda number: str(number).replace("-", "\N{MINUS SIGN}"),
        "order_table": _order_table(numbers),
        "poles": {mode: _roots(numbers["poles"][mode]) for mode in ("pitch", "roll")},
        "zeros": _roots(list(reversed(numbers["zeros"]))),
    }
    sections: List[Tuple[str, str, str]] = []
    for path in sorted((sources / "text").glob("*.html")):
        title = re.match(r"\{# title: (.*) #\}", path.read_text(encoding="utf-8"))[1]
        text = environment.get_template(f"text/{path.name}").render(values)
        sections.append((path.stem.split("_", 1)[1], html.escape(title), typeset(text).strip()))
    return environment.get_template("page.html").render(
        style=style,
        description=html.escape(description.description),
        version=html.escape(description.version),
        license=html.escape(description.license),
        sections=sections,
    )


def typeset(text: str) -> str:
    r"""LaTeX between \( \) and \[ \] as MathML; \tag{8} in the latter puts the paper's number beside the equation."""
    try:
        from latex2mathml.converter import convert
    except ImportError:
        raise UserError("the package latex2mathml is missing; `make docs` installs it") from None

    def inline(match) -> str:
        return _plain(convert(html.unescape(match[1]), display="inline"))

    def block(match) -> str:
        tag = re.search(r"\\tag\{(.*?)\}", match[1])
        formula = _plain(convert(re.sub(r"\\tag\{.*?\}", "", match[1]).strip(), display="block"))
        number = f'<span class="number">({tag[1]})</span>' if tag else ""
        return f'<div class="equation">{formula}{number}</div>'

    return re.sub(r"\\\((.+?)\\\)", inline, re.sub(r"\\\[(.+?)\\\]", block, text, flags=re.S), flags=re.S)


def _plain(mathml: str) -> str:
    """Without what HTML does not need; matrices get brackets from the style sheet, for brackets made of characters grow
    with the matrix only where the reader has a font for mathematics."""
    mathml = mathml.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', "")
    special = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
    mathml = re.sub(r"&#x([0-9A-Fa-f]+);", lambda m: special.get(chr(int(m[1], 16)), chr(int(m[1], 16))), mathml)
    return re.sub(r"<mo>\[</mo><mtable>(.*?)</mtable><mo>\]</mo>", r'<mtable class="matrix">\1</mtable>', mathml)


def _figure(path: Path, meaning: str) -> str:
    """A figure's SVG, to be put into the page, with what it shows in words."""
    try:
        svg = path.read_text(encoding="utf-8")
    except OSError:
        raise UserError(f"{path}: missing; `prw figures --commit` makes it") from None
    start = f'<svg class="plot" role="img" aria-label="{html.escape(meaning)}"'
    return svg.strip().replace('<svg xmlns="http://www.w3.org/2000/svg"', start, 1)


def _variable_table(description, causality: str, title: str) -> str:
    rows = []
    for variable in description.modelVariables:
        if variable.causality == causality:
            unit = _unit(variable)
            rows.append(
                f"<tr><td><code>{html.escape(variable.name)}</code></td><td>{html.escape(_pretty(unit))}</td>"
                f'<td class="meaning">{html.escape(variable.description)}</td></tr>'
            )
    return _table(title, ("name", "unit", "meaning"), rows)


def _parameter_table(description, printed: Dict[str, Dict]) -> str:
    rows = []
    for variable in description.modelVariables:
        if variable.causality != "parameter":
            continue
        unit = _unit(variable)
        start = variable.start if variable.type != "Real" else f"{float(variable.start):.8g}"
        paper = printed.get(variable.name)
        as_printed = f"{paper['value']:.8g} {_pretty(paper['unit'])}" if paper else ""
        label = ' data-label="printed:"' if as_printed else ""
        rows.append(
            f'<tr><td><code>{html.escape(variable.name)}</code></td><td class="number">{start}</td>'
            f'<td>{html.escape(_pretty(unit))}</td><td class="number"{label}>{html.escape(as_printed.strip())}</td>'
            f'<td class="meaning">{html.escape(variable.description)}</td></tr>'
        )
    return _table("", ("name", "start", "unit", "as printed", "meaning"), rows, numbers=(1, 3))


def _order_table(numbers: Dict) -> str:
    rows = []
    for name, words in OUTPUT_NAMES.items():
        orders = f"{numbers['order_angles'][name]:.2f}", f"{numbers['order_rates'][name]:.2f}"
        cells = (*orders, str(numbers["error_1ms_percent"][name]))
        rows.append(f"<tr><td>{words}</td>" + "".join(f'<td class="number">{cell}</td>' for cell in cells) + "</tr>")
    return _table(
        "", ("output", "order, angles alone", "order, use_omega", "error at 1 ms (%)"), rows, numbers=(1, 2, 3)
    )


def _table(title: str, heads, rows, numbers=()) -> str:
    """An HTML table; `numbers` are the columns that are set flush right. With a meaning, rows can become paragraphs."""
    kinds = (' class="number"' if column in numbers else "" for column in range(len(heads)))
    head = "".join(f"<th{kind}>{text}</th>" for kind, text in zip(kinds, heads))
    heading = f"<h3>{title}</h3>\n" if title else ""
    body = "\n".join(rows)
    kind = ' class="rows"' if "meaning" in heads else ""
    parts = f"<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>"
    return f'{heading}<div class="scroll"><table{kind}>\n{parts}\n</table></div>'


def _unit(variable) -> str:
    return variable.unit or getattr(variable.declaredType, "unit", None) or ""


def _pretty(unit: str) -> str:
    """kg.m2 as kg m²; the unit 1 as nothing."""
    narrow = "\N{NARROW NO-BREAK SPACE}"
    return "" if unit == "1" else unit.replace(".", narrow).replace("s2", "s²").replace("m2", "m²")


def _roots(roots) -> str:
    """Real and conjugate complex numbers in words: -174.873 and -9.68 ± 34.68 i."""
    words = []
    for real, imaginary in roots:
        words.append(f"{real:.2f}" + (f" ± {imaginary:.2f} i" if imaginary else ""))
    return " and ".join(words).replace("-", "−")
