"""The rules that the files of the repository keep. Each rule is a row of `RULES`, with the files that it is for and a text that breaks
it, because a rule that finds nothing protects nobody. Standard tools check the rest: ruff, mypy, clippy, actionlint, zizmor."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterable
from typing import NamedTuple

import pytest
from built import ROOT
from repository import FILES, PACKAGES, RELEASED, TARGETS, WORKSPACE, text, texts

#: Sites that pages may name: documentation and sources, but not package registries.
HOSTS = "docs.rs|github.com|rustup.rs|semver.org"
#: Directories that builds create and git does not track.
MADE = ("out/", "dist/", "target/", ".venv")
LINK = re.compile(r"\]\(<?([^)>\s]+)[^)]*\)|^\[[^\]]+\]:\s*(\S+)|(?:href|src)=\"([^\"]+)\"", re.MULTILINE)
CODE = re.compile(r"^```.*?^```|`[^`\n]+`", re.DOTALL | re.MULTILINE)
#: This file, which contains faults.
THIS = "tests/publication/test_files.py"
OLDEST_RUST = re.escape(WORKSPACE["package"]["rust-version"])
#: Names under which anyone could register a package before the project does.
OWN = "|".join({*PACKAGES, "fmu-run", "fmu_run", "prw"})
LONGEST_SENTENCE = 40

Find = Callable[[str, str], Iterable[str]]


def pattern(expression: str) -> Find:
    """Returns a function that finds the matches of a regular expression."""
    return lambda _, content: (found[0] for found in re.finditer(expression, content, re.MULTILINE | re.DOTALL))


def links(content: str) -> list[str]:
    """Returns the targets of a page's links and images, except those in code."""
    return ["".join(found) for found in LINK.findall(CODE.sub("", content))]


def anchors(page: str) -> set[str]:
    """Returns the anchors of a page: ids, and in Markdown the headings as GitHub names them."""
    headings = re.findall(r"^#+ (.*)$", text(page), re.MULTILINE) if page.endswith(".md") else []
    ids = re.findall(r'\bid="([^"]+)"', text(page))
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings} | {*ids}


def dead_links(name: str, content: str) -> Iterable[str]:
    for link in links(content):
        path, _, anchor = link.partition("#")
        target = os.path.normpath(os.path.join(os.path.dirname(name), path)) if path else name
        if not re.match("[a-z]+:", link) and not (
            (ROOT / target).exists() and (not anchor or anchor in anchors(target))
        ):
            yield link


def links_out_of_the_crate(name: str, content: str) -> Iterable[str]:
    for link in links(content):
        if not re.match("[a-z]+:|#", link) and os.path.normpath(link).startswith(".."):
            yield link


def unknown_targets(name: str, content: str) -> Iterable[str]:
    code = "\n".join(CODE.findall(content)) if name.endswith(".md") else content
    yield from {*re.findall(r"(?:`|^|&& )make ([a-z][\w-]*)", code, re.MULTILINE)} - TARGETS.keys()


def missing_paths(name: str, content: str) -> Iterable[str]:
    """Checks all paths in CONTRIBUTING.md; in other pages, paths that begin with a directory of the project."""
    kept, directories = [f"/{path}/" for path in FILES], {path.split("/")[0] for path in FILES if "/" in path}
    for path in re.findall(r"`([\w.-]+/[\w./-]*|[\w-]+\.(?:rs|py|md|xml|lock))`", content):
        checked = name == "CONTRIBUTING.md" or path.split("/")[0] in directories
        if checked and not path.startswith(MADE) and not any(f"/{path.rstrip('/')}/" in other for other in kept):
            yield path


def unknown_tests(_: str, content: str) -> Iterable[str]:
    """A command whose filter names no test would run none and succeed."""
    rust, python = texts(r".*\.rs"), texts(r"tests/.*\.py")
    value = r"-p|--package|--bin|--profile|--test|--message-format"
    for arguments in re.findall(r"\bcargo (?:test|nextest run)((?: +[\w:=-]+)+)", re.sub("(?m)^# .*", "", content)):
        words = re.sub(rf" (?:{value}) \S+| --[\w=-]+| -\w| \d>.*| --(?= |$)", "", arguments).replace("::", " ").split()
        yield from (word for word in words if not re.search(rf"\b(fn|mod) \w*{word}", rust))
    for chosen in re.findall(r"pytest[^\n]*(?:\n +[^\n]*)*? -k (\"[^\"]+\"|\w+)", content):
        names = {*re.findall(r"\w+", chosen)} - {"not", "and", "or"}
        yield from (name for name in names if not re.search(rf"\bdef test_\w*{name}", python))


def long_sentences(_: str, content: str) -> Iterable[str]:
    prose = re.sub(r"^ {4,}\S.*?$|<!--.*?-->|\]\([^)]*\)|^\|.*?$", "", CODE.sub("CODE", content), flags=re.S | re.M)
    for block in re.split(r"\n\s*\n|\n(?=\s*(?:[*#-]|\d+\.) )", prose):
        for sentence in re.split(r"(?<=[.!?])(?<!\beq\.)(?<!eqs\.)(?<!Fig\.)(?<!Sec\.)\W*\s+", block):
            if len(re.findall(r"\S*\w\S*", sentence)) > LONGEST_SENTENCE:
                yield sentence


def models_in_the_clone(_: str, content: str) -> Iterable[str]:
    """In the clone, `cargo fmu new` would change Cargo.toml, because cargo adds the model to the workspace."""
    for block in re.findall(r"^```.*?^```", content, re.DOTALL | re.MULTILINE):
        yield from re.findall(r"cargo install --path crates/(?:(?!\bcd \.\.).)*cargo fmu new", block, re.DOTALL)


class Rule(NamedTuple):
    """A rule of some files."""

    #: Regular expression of the paths.
    files: str
    #: Finds what breaks the rule in a file, from its path and content.
    find: Find
    #: Content of the first of these files that breaks the rule.
    faulty: str


MD, WORKFLOW = r".*\.md", r"\.github/workflows/.*\.yml"
RULES = {
    "links have targets": Rule(rf"{MD}|CITATION.cff", dead_links, "See [it](missing.md)."),
    "a crate is read without the repository": Rule(
        r"crates/[^/]+/README.md", links_out_of_the_crate, "[it](../../LICENSE-MIT)"
    ),
    "release notes are copied to other pages": Rule(
        "CHANGELOG.md", pattern(r"\]\((?!https://)[^)]*\)"), "[it](README.md)"
    ),
    "other sites are documentation or sources": Rule(
        rf"{MD}|CITATION.cff", pattern(rf"https?://(?!(?:{HOSTS})(?![\w.]))[\w.-]+"), "<https://example.com>"
    ),
    "no path is of one machine only": Rule(
        r".*\.(md|toml|yml|html|svg|json)|Makefile",
        pattern(r"(?<![\w./])/(?:home/(?!me/)|Users/|root/|work/|tmp/\w)[\w./-]*"),
        "cd /home/someone/clone",
    ),
    "named make targets exist": Rule(
        r"(?!CHANGELOG).*(\.(md|py|rs|toml|html|yml)|Makefile)", unknown_targets, "`make absent`"
    ),
    "named paths exist": Rule(rf"(?!CHANGELOG|crates/){MD}", missing_paths, "`docs/absent.md`"),
    "named tests exist": Rule(
        rf"{MD}|{WORKFLOW}|Makefile|dev/sanitize", unknown_tests, "cargo test -p fmu-run absent_test"
    ),
    "pages name the oldest Rust": Rule(
        rf"(?!CHANGELOG){MD}",
        pattern(rf"\bRust(?:\]\([^)]*\))?(?: is)? (?!{OLDEST_RUST}\b)\d+\.\d+"),
        "It needs Rust 1.0.",
    ),
    "models are created outside of the clone": Rule(
        rf"(?!CHANGELOG){MD}",
        models_in_the_clone,
        "```sh\ncargo install --path crates/fmu-package\ncargo fmu new m\n```",
    ),
    "nothing of the project is installed from a registry before its release": Rule(
        r".*\.(md|py|rs|toml|html|yml)|Makefile",
        pattern(
            "(?!)"
            if RELEASED
            else rf"(?:pip|cargo) install (?!--(?:no-index|git|path)\b)(?:-\S+ )*[\"']?(?:{OWN})\b(?![/.\w-])|docs\.rs/(?:{OWN})\b"
        ),
        "" if RELEASED else "pip install prw",
    ),
    "pages do not deny a release": Rule(
        MD,
        pattern(r"not\s+published\s+yet|no\s+download\s+yet" if RELEASED else "(?!)"),
        "not published yet" if RELEASED else "",
    ),
    "actions are commits, with their version": Rule(
        rf"{WORKFLOW}|{MD}",
        pattern(r"\buses: (?![\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+$)\S+"),
        "- uses: actions/checkout@v7\n",
    ),
    "tools of workflows have versions": Rule(
        WORKFLOW,
        pattern(
            r"cargo install (?!--locked [\w-]+@\d+\.\d+\.\d+$).*?$|pip install (?![\w-]+==[\d.]+$|[^\n\\]*--require-hashes |--no-index ).*?$"
        ),
        "- run: pip install twine\n",
    ),
    # fmu-export receives callbacks. measure.rs looks up a function of the C library, which not all of its versions have.
    "FMUs are called by the module calls of fmi-abi": Rule(
        r"(?!crates/(?:fmi-abi/(?:Cargo|src/(?:calls|fmi2|fmi3)/)|fmu-export/|fmu-check/src/worker/measure)).*(\.rs|Cargo\.toml)",
        pattern(
            r"\b(?:libloading|dlopen|transmute|fmi2CallbackLogger|fmi3LogMessageCallback|fmi2CallbackFunctions {)"
            r"|extern \"C\" fn \w+(?:<[^>]*>)?\(\s*\w*environment:"
        ),
        "let library = unsafe { libloading::Library::new(path) };",
    ),
    "sentences are short enough to be read once": Rule(MD, long_sentences, f"It is {'very ' * LONGEST_SENTENCE}long."),
}


@pytest.mark.parametrize("name", RULES)
def test_files_keep_the_rule(name: str) -> None:
    rule = RULES[name]
    found = {file: [*rule.find(file, text(file))] for file in FILES if re.fullmatch(rule.files, file) and file != THIS}
    assert found and {file: faults for file, faults in found.items() if faults} == {}


@pytest.mark.parametrize("name", [name for name, rule in RULES.items() if rule.faulty])
def test_a_fault_is_found(name: str) -> None:
    rule = RULES[name]
    file = next(file for file in FILES if re.fullmatch(rule.files, file))
    assert [*rule.find(file, rule.faulty)] and not [*rule.find(file, "Nothing is wrong here.\n")]
