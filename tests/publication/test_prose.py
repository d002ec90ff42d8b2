"""Checks the prose of the Markdown pages: words that have a plainer replacement, openings, and the length of sentences."""

from __future__ import annotations

import re

import pytest
from built import ROOT
from test_readmes import FILES

#: The rules of fmu-check, whose names contain such words.
NOT_COVERED = {"crates/fmu-check/RULES.md"}
COVERED = [name for name in FILES if name.endswith(".md") and name not in NOT_COVERED]
#: Patterns of words and phrases, each with its replacement.
PLAINER = {
    "that of|those of": "the noun again",
    "says?|said|tells?|told": "report, state; distinguish",
    "refus(?:e|es|ed|al|als|ing)": "reject, error",
    "to the bit": "bit-identical",
    "to rounding": "within rounding error",
    "anew": "again",
    "apart": "separately",
    "beside": "next to, compared with",
    "toys?": "test model",
    "zero bytes?": "NUL",
    "what(?:ever)?|wherever|whoever|nobody": "a noun, any, regardless of",
    "wires?|wired|wiring to": "connect, connection",
    "truths?": "Boolean, true value",
    "whole numbers?": "integer",
    "promis(?:e|es|ed)": "guarantee, requirement",
    "mended": "fixed",
    "hostile": "malformed, adversarial",
    "both standards": "both FMI versions",
    "of others": "third-party",
    r"of its own(?=[.,;:)]| and)": "separate",
    "in the hand": "stateful, held",
    "travels? in": "is included in",
    "careless importer": "fault-injecting importer",
    r"derivatives? by(?! \w+ing)": "derivative with respect to",
    r"as \w+ has it": "as in",
    "stands": "is written, is at rest, is",
    "(?:a|per) decision a|(?:steps?|runs?) a second": "per second",
}
LONGEST = 40


def without_code(page: str) -> str:
    """Returns the page without code, comments, tags, targets of links, and quoted messages, which are in italics."""
    page = re.sub(r"^```.*?^```$|^ {4,}\S.*?$|<!--.*?-->", "", page, flags=re.DOTALL | re.MULTILINE)
    page = re.sub(r"\]\([^)]*\)", "]", re.sub(r"`[^`]+`|“[^”]+”", "CODE", page))
    return re.sub(r"<[^>]+>|(?<!\*)\*(?![\s*])[^*]+\*(?!\*)", "", page)


def paragraphs(page: str) -> list[str]:
    """Returns the headings, paragraphs and items of lists, each on one line, without tables."""
    text = "\n".join("" if line.startswith("|") else line for line in without_code(page).splitlines())
    blocks = re.split(r"\n\s*\n|\n(?=\s*(?:[*#-]|\d+\.) )|(?<=^#)\n", text)
    return [re.sub(r"^\s*(?:[*#-]+|\d+\.)\s+", "", " ".join(block.split())) for block in blocks if block.strip()]


def sentences(paragraph: str) -> list[str]:
    """Returns the sentences. The dot of an abbreviation ends none."""
    text = re.sub(r"\b(eqs?|Figs?|Sec|e\.g|i\.e)\.", r"\1", paragraph.replace("**", ""))
    return re.split(r"(?<=[.!?])\s+", text)


def faults(page: str) -> list[str]:
    """Returns the faults of a page."""
    text = " ".join(without_code(page).split())
    found = []
    for pattern, plainer in PLAINER.items():
        for match in re.finditer(rf"(?<![\w-])(?:{pattern})(?![\w-])", text, re.IGNORECASE):
            context = text[max(0, match.start() - 30) : match.end() + 30]
            found.append(f"{match[0]!r} in '... {context} ...': {plainer}")
    for paragraph in paragraphs(page):
        if re.match(r"(?:It|The same)\b", paragraph):
            found.append(f"begins with a pronoun: {paragraph[:60]}")
        for sentence in sentences(paragraph):
            if re.match(r"(?:What|Of|Those)\b", sentence):
                found.append(f"opening: {sentence[:60]}")
            if (count := len(re.findall(r"\S*\w\S*", sentence))) > LONGEST:
                found.append(f"{count} words: {sentence[:60]}")
    return found


@pytest.mark.parametrize("name", COVERED)
def test_prose_is_plain(name: str) -> None:
    assert faults((ROOT / name).read_text(encoding="utf-8")) == []


def test_uncovered_pages_exist() -> None:
    assert set(FILES) >= NOT_COVERED


@pytest.mark.parametrize(
    ("page", "fault"),
    [
        ("The state and that of\nthe motor.", "'that of'"),
        ("| a | equal to the bit |\n", "'to the bit'"),
        ("Text.\n\n* It starts.", "begins with a pronoun: It"),
        ("# Of the project", "opening: Of"),
        ("One. Those follow.", "opening: Those"),
        (f"Short. Now {'very ' * 40}long.", "42 words: Now very"),
    ],
)
def test_faults_are_found(page: str, fault: str) -> None:
    assert any(found.startswith(fault) for found in faults(page)), faults(page)


def test_code_and_messages_are_not_prose() -> None:
    page = "Run `that of`.\n\n```sh\necho to the bit anew\n```\n\n    toy = 1\n\n*cannot be told apart*: see [it](what.md). <b>x</b>\n"
    assert faults(page) == []
    assert faults(f"| {'word ' * 50}|\n") == []
