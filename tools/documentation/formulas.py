r"""LaTeX between \( \) and \[ \]: as MathML for the pages, as plain text for README."""

from __future__ import annotations

import html
import re

from prw.errors import UserError

#: What is left of LaTeX in plain text: `\dot\theta_1` is theta1', as the FMU's variables and the tables write it.
PLAIN = (
    (r"\\dot\{?(\\[a-zA-Z]+(?:\{\w\})?)\}?(_\w|_\{\w+\})?", r"\1\2'"),
    (r"\\mathbf\{(\w+)\}", r"\1"),
    (r"\\(theta|pi|sin)(?![a-zA-Z])", r"\1"),
    (r"_\{(\w+)\}|_(\w)", r"\1\2"),
    (r"(?<=\S)-(?=\S)", " - "),
    (r"(?<=\d)(?=pi)", " "),
)


def typeset(text: str) -> str:
    r"""Formulas as MathML; \tag{8} between \[ \] puts the paper's number beside the equation."""
    try:
        from latex2mathml.converter import convert
    except ImportError:
        raise UserError("the package latex2mathml is missing; `make docs` installs it") from None

    def inline(match) -> str:
        return _tidy(convert(html.unescape(match[1]), display="inline"))

    def block(match) -> str:
        tag = re.search(r"\\tag\{(.*?)\}", match[1])
        formula = _tidy(convert(re.sub(r"\\tag\{.*?\}", "", match[1]).strip(), display="block"))
        number = f'<span class="number">({tag[1]})</span>' if tag else ""
        return f'<div class="equation">{formula}{number}</div>'

    return re.sub(r"\\\((.+?)\\\)", inline, re.sub(r"\\\[(.+?)\\\]", block, text, flags=re.S), flags=re.S)


def _tidy(mathml: str) -> str:
    """Without what HTML does not need; matrices get brackets from the style sheet, for brackets made of characters grow
    with the matrix only where the reader has a font for mathematics."""
    mathml = mathml.replace(' xmlns="http://www.w3.org/1998/Math/MathML"', "")
    special = {"&": "&amp;", "<": "&lt;", ">": "&gt;"}
    mathml = re.sub(r"&#x([0-9A-Fa-f]+);", lambda m: special.get(chr(int(m[1], 16)), chr(int(m[1], 16))), mathml)
    return re.sub(r"<mo>\[</mo><mtable>(.*?)</mtable><mo>\]</mo>", r'<mtable class="matrix">\1</mtable>', mathml)


def plain(text: str) -> str:
    """Formulas as plain text. Raises UserError for LaTeX that has no such form here."""

    def formula(match) -> str:
        words = match[1]
        for pattern, instead in PLAIN:
            words = re.sub(pattern, instead, words)
        if re.search(r"[\\{}]", words):
            raise UserError(
                f"no plain text is known for the formula {match[0]}; add it in tools.documentation.formulas"
            )
        return words

    return re.sub(r"\\\((.+?)\\\)", formula, text)
