"""Numbers, tables and messages in pages, and the versions in all files, agree with the sources from which they come."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from decimal import ROUND_HALF_UP, Decimal
from pathlib import Path

import pytest
from built import ROOT
from repository import FILES, PACKAGES, TARGETS, VERSION, in_one_line, manifest, text, texts

from tools.documentation.sources import read_table

RATIOS = json.loads(text("dev/benches/ratios.json"))
#: The fourth ratio of each run compares FMPy with fmu_run.
FMPY = {name: ratios[4] for name, ratios in RATIOS["runs"].items()}


def tools_that_ran() -> set[str]:
    """Returns the importers of third parties that have run the FMU."""
    rows = read_table(ROOT / "docs/compatibility.md", "At a glance").rows
    ran = {row[0].split("]")[0].strip("[").removesuffix("'s runtime") for row in rows if {"✓", "(✓)"} & {*row}}
    return {name for name in ran if not name.startswith(("fmu_run", "Programs in C"))}


def tools_in_make_test() -> str:
    """Returns how many of these importers `make test` runs, as a word."""
    (listed,) = re.findall(
        r"`make test` runs (.*?), fmu_run and the programs in C\.", in_one_line("docs/compatibility.md")
    )
    assert all(any(name.split()[0] in tool for tool in tools_that_ran()) for name in listed.split(", ")), listed
    return ("four", "five", "six", "seven", "eight", "nine", "ten")[len(listed.split(", ")) - 4]


def reference_fmus() -> int:
    """Returns the number of Reference FMUs in which fmu-check finds a violation."""
    (counts,) = re.findall(r"(\d+) FMUs for FMI 2\.0 and (\d+) for FMI 3\.0", in_one_line("docs/checking.md"))
    return sum(map(int, counts))


def seeded_faults() -> int:
    lists = [name for name in FILES if re.fullmatch(r"tests/faults/.*\.toml", name)]
    return sum(len(manifest(name)["fault"]) for name in lists)


def tolerance() -> str:
    (stated,) = set(re.findall(r"assert_close\(values, true_values, (\S+)\)", text("tests/fmpy/test_exactness.py")))
    return str(stated)


def step_ratio() -> str:
    return str(
        Decimal(str(RATIOS["steps"]["angles set, step, 4 outputs, as vectors"][0])).quantize(
            Decimal("0.1"), ROUND_HALF_UP
        )
    )


#: Statements with a number, each with its page and the function that returns the number.
NUMBERS: list[tuple[str, str, Callable[[], object]]] = [
    ("README.md", "| **Exact** | within {} of the exact solution", tolerance),
    ("README.md", "takes 1/{} of the time that it takes with FMPy", lambda: round(FMPY["testbed"])),
    ("docs/README.md", "| {} times as long as a loop in C", lambda: RATIOS["runs"]["testbed"][0]),
    ("docs/README.md", "| {} times as long as fmu_run", lambda: round(FMPY["testbed"])),
    ("docs/README.md", "| {} runs per second |", lambda: f"{RATIOS['loops']['fmu_run, 1 thread'][0]:,.0f}"),
    ("README.md", "{} other tools have run it", lambda: len(tools_that_ran())),
    ("README.md", "{} of them do so in `make test`", tools_in_make_test),
    ("crates/fmu-check/README.md", "In each of the {} Reference FMUs", reference_fmus),
    ("crates/fmu-export/README.md", "takes about {} times as long as in C", step_ratio),
    ("docs/robustness.md", "puts the {} faults of `tests/faults`", seeded_faults),
]


@pytest.mark.parametrize(("page", "statement", "number"), NUMBERS, ids=[statement for _, statement, _ in NUMBERS])
def test_numbers(page: str, statement: str, number: Callable[[], object]) -> None:
    stated = re.findall(re.escape(statement).replace(r"\{\}", r"([\w.,-]+)"), in_one_line(page))
    assert stated == [str(number())]


def test_the_speed_of_fmu_run() -> None:
    ((least, most),) = re.findall(
        r"run (\d+) to (\d+) times as fast as with FMPy", in_one_line("crates/fmu-run/README.md")
    )
    assert all(int(least) <= ratio <= int(most) for ratio in FMPY.values()), FMPY


def test_all_files_have_one_version() -> None:
    """Cargo itself compares the versions of the crates in the workspace. An unreleased version has no date."""
    dates = dict(re.findall(r"^## ([\d.]+)(?: \((?:unreleased|([\d-]+))\))?$", text("CHANGELOG.md"), re.MULTILINE))
    assert VERSION in dates and not any(list(dates.values())[: list(dates).index(VERSION)])
    cited = dict(re.findall(r"^(version|date-released): (.*)$", text("CITATION.cff"), re.MULTILINE))
    assert cited == {"version": VERSION} | ({"date-released": dates[VERSION]} if dates[VERSION] else {})
    prw = manifest("python/prw/pyproject.toml")["project"]
    assert prw["version"] == VERSION and f"fmu-run~={VERSION}" in prw["dependencies"]
    for path in (path for path in FILES if path.endswith("Cargo.lock")):
        versions = {each["name"]: each["version"] for each in manifest(path)["package"]}
        assert {versions.get(name, VERSION) for name in PACKAGES} == {VERSION}, (
            f"run `cargo update --workspace`: {path}"
        )


def test_the_diagram_of_the_crates() -> None:
    """The diagram in docs/architecture.md has an arrow for each dependency among the crates, dashed if the dependency is optional."""
    expected = {
        f"{name} {'-.->' if isinstance(how, dict) and how.get('optional') else '-->'} {needed}"
        for name, content in PACKAGES.items()
        for needed, how in content.get("dependencies", {}).items()
        if needed in PACKAGES
    }
    (diagram,) = re.findall(r"^```mermaid\ngraph TD\n(.*?)^```", text("docs/architecture.md"), re.DOTALL | re.MULTILINE)
    assert {line.strip() for line in diagram.splitlines()} == expected


def test_unsafe_code_is_where_the_page_states() -> None:
    """The table lists exactly the crates with unsafe code. So it does not list the model in src/, which has none."""
    code = re.compile(r"^(?!\s*//).*\bunsafe (?:\{|fn|extern|impl|trait)", re.MULTILINE)
    sources = [name for name in FILES if re.match(r"(?:src|(?:crates|examples)/.*/src)/.*\.rs$", name)]
    found = {re.sub(r"/src/.*", "/src", name) for name in sources if code.search(text(name))}
    section = text("docs/architecture.md").split("## Where unsafe")[1].split("\n## ")[0]
    assert set(re.findall(r"^\| `(crates/\S+)`", section, re.MULTILINE)) == found


def test_the_makefile_and_contributing_list_everything() -> None:
    shown = set(re.findall(r"^\t@echo 'make ([\w-]+)", text("Makefile"), re.MULTILINE))
    needed = {name for names in TARGETS.values() for name in names.split()}
    assert TARGETS.keys() - needed - {"help"} <= shown <= TARGETS.keys()
    tree = text("CONTRIBUTING.md").split("## Directories")[1].split("```\n")[1]
    for path in {path.split("/")[0] for path in FILES if "/" in path and not path.startswith(".")}:
        assert re.search(rf"^{path}/", tree, re.MULTILINE), path


def test_messages_in_the_tutorial_are_in_the_sources() -> None:
    """Looks for two consecutive words of each message, because the sources insert names and numbers."""
    # A string may continue on the next line.
    code = re.sub(r"\"\s*\n\s*f?\"|`", "", texts(r"python/prw/src/.*\.(?:py|j2)"))
    messages = re.findall(r"(?<![*\w])\*([^*\s][^*\n]*)\*(?!\*)", text("python/prw/tutorial.md"))
    assert len(messages) > 9
    for words in (found.split() for found in messages):
        assert any(" ".join(pair) in code for pair in zip(words, words[1:] or [""])), words


def test_docstrings_make_a_reference_without_warnings(tmp_path: Path) -> None:
    """Sphinx warns of unresolved links, undocumented parameters and missing sections."""
    options = ["--quiet", "--fail-on-warning", "--keep-going", "--doctree-dir", str(tmp_path / "trees")]
    command = [sys.executable, "-m", "sphinx", *options, str(ROOT / "docs/reference"), str(tmp_path / "html")]
    finished = subprocess.run(command, capture_output=True, text=True)
    assert finished.returncode == 0 and not finished.stderr, finished.stderr
