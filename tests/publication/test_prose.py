"""Checks the prose of the Markdown pages: words that only this project uses, and long sentences. Ordinary words are never forbidden,
because authors would write around them. Pages that readers open first should explain, so the test warns
if they have too few connecting words. In code, only one phrase is checked: “is no X”, where “is not an X” is meant."""

from __future__ import annotations

import re
import warnings

import pytest
from built import ROOT
from test_readmes import FILES

#: The rules of fmu-check, whose names contain such words.
NOT_COVERED = {"crates/fmu-check/RULES.md"}
COVERED = [name for name in FILES if name.endswith(".md") and name not in NOT_COVERED]
#: Code, whose comments and messages are checked.
CODE = [name for name in FILES if name.endswith((".c", ".h", ".js", ".py", ".rs"))]
IS_NO = r"(?<!there )(?:is|are|was|were) no(?! longer| more)(?= )"
#: Patterns of private words and phrases, each with the usual word.
PRIVATE = {
    "that of|those of": "the noun again",
    IS_NO: "is not a, is not",
    "situations?": "state, allowed states",
    "refus(?:e|es|ed|al|als|ing)": "reject, error",
    "to the bit": "bit-identical",
    "to rounding": "within rounding error",
    "anew": "again",
    "beside": "next to, compared with",
    "toys?": "test model",
    "zero bytes?": "NUL",
    "whatever|wherever|whoever": "any, regardless of",
    "wires?|wired|wiring to": "connect, connection",
    "truths?": "Boolean, true value",
    "whole numbers?": "integer",
    "mended": "fixed",
    "hostile": "malformed, adversarial",
    "grades?": "severity",
    "both standards": "both FMI versions",
    r"of its own(?=[.,;:)]| and)": "separate",
    "in the hand": "stateful, held",
    "travels? in": "is included in",
    "careless importer": "fault-injecting importer",
    r"derivatives? by(?! \w+ing)": "derivative with respect to",
    r"as \w+ has it": "as in",
    "(?:a|per) decision a|(?:steps?|runs?) a second": "per second",
}
LONGEST = 40
#: Pages that a reader opens first, words that join a fact with its reason, condition or consequence, and their least number in 100
#: words. README files of three well-written libraries have 1.0 to 1.9.
FRONT_PAGES = [name for name in COVERED if name.endswith("README.md")]
CONNECTING = "because|so|but|if|unless|although|since|which|while|therefore|whether|until"
LEAST = 1.0


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
    """Returns the sentences. A dot after an abbreviation does not end a sentence."""
    text = re.sub(r"\b(eqs?|Figs?|Sec|e\.g|i\.e)\.", r"\1", paragraph.replace("**", ""))
    return re.split(r"(?<=[.!?])\s+", text)


def faults(page: str) -> list[str]:
    """Returns the faults of a page."""
    text = " ".join(without_code(page).split())
    found = []
    for pattern, usual in PRIVATE.items():
        for match in re.finditer(rf"(?<![\w-])(?:{pattern})(?![\w-])", text, re.IGNORECASE):
            context = text[max(0, match.start() - 30) : match.end() + 30]
            found.append(f"{match[0]!r} in '... {context} ...': {usual}")
    for paragraph in paragraphs(page):
        for sentence in sentences(paragraph):
            if (count := len(re.findall(r"\S*\w\S*", sentence))) > LONGEST:
                found.append(f"{count} words: {sentence[:60]}")
    return found


@pytest.mark.parametrize("name", COVERED)
def test_prose_is_plain(name: str) -> None:
    assert faults((ROOT / name).read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("name", FRONT_PAGES)
def test_front_pages_explain(name: str) -> None:
    """Warns but never fails, because a page can explain without these words."""
    text = without_code((ROOT / name).read_text(encoding="utf-8"))
    words = re.findall(r"[A-Za-z]+", text)
    found = 100 * len(re.findall(rf"\b(?:{CONNECTING})\b", text, re.IGNORECASE)) / len(words)
    if len(words) > 100 and found < LEAST:
        warnings.warn(f"{name}: {found:.1f} connecting words in 100; usual are {LEAST} or more", stacklevel=1)


def in_one_line(code: str) -> str:
    """Returns code with its comments and strings joined over the ends of lines."""
    return re.sub(r"(?:\n\s*(?://[/!]?|#:?|\*)|\\\n|\s)+", " ", code)


def test_code_states_what_something_is_not() -> None:
    found = []
    for name in CODE:
        text = in_one_line((ROOT / name).read_text(encoding="utf-8"))
        matches = re.finditer(rf"(?<![\w-]){IS_NO}", text, re.IGNORECASE)
        found += [f"{name}: {text[max(0, match.start() - 40) : match.end() + 20]}" for match in matches]
    # The phrase is quoted here.
    assert [line for line in found if not line.startswith("tests/publication/test_prose.py")] == []


def test_phrases_are_found_over_the_ends_of_lines() -> None:
    code = '// It is\n    // no FMU.\n/// There\n/// is no way.\n    "there are \\\n     no others"\n#: That was\n#: no table.\n'
    assert re.findall(IS_NO, in_one_line(code), re.IGNORECASE) == ["is no", "was no"]


def test_uncovered_pages_exist() -> None:
    assert set(FILES) >= NOT_COVERED


@pytest.mark.parametrize(
    ("page", "fault"),
    [
        ("The state and that of\nthe motor.", "'that of'"),
        ("| a | equal to the bit |\n", "'to the bit'"),
        ("A file that is no FMU.", "'is no'"),
        (f"Short. Now {'very ' * 40}long.", "42 words: Now very"),
    ],
)
def test_faults_are_found(page: str, fault: str) -> None:
    assert any(found.startswith(fault) for found in faults(page)), faults(page)


def test_code_and_messages_are_not_prose() -> None:
    page = "Run `that of`.\n\n```sh\necho to the bit anew\n```\n\n    toy = 1\n\n*they are anew*: see [it](what.md). <b>x</b>\n"
    assert faults(page) == []
    assert faults(f"| {'word ' * 50}|\n") == []


def test_ordinary_words_are_allowed() -> None:
    assert (
        faults("What the page says tells them apart. There is no limit, and nobody is no longer sure. It stands.") == []
    )
