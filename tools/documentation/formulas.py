r"""LaTeX between \( \) and \[ \]: as MathML for the pages."""

from __future__ import annotations

import html
import re

from prw.errors import UserError


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
    """Remove parts that HTML does not need. Matrices get brackets from the style sheet, because brackets that are characters
    grow with the matrix only with a font for mathematics."""
    mathml = mathml.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', "")
    special = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
    mathml = re.sub(r"&#x([0-9A-Fa-f]+);", lambda m: special.get(chr(int(m[1], 16)), chr(int(m[1], 16))), mathml)
    return re.sub(r"<mo>\[</mo><mtable>(.*?)</mtable><mo>\]</mo>", r'<mtable class="matrix">\1</mtable>', mathml)
