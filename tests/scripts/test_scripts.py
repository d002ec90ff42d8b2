"""Runs the programs that maintain this repository, which `make test` starts nowhere else, with small counts."""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
from itertools import chain
from pathlib import Path

import pytest
from benches import instructions
from built import ROOT, built

from prw.cli import run as run_command
from tools import changed, figures
from tools.documentation import performance
from tools.figures import animation, plots, screencast

#: A fault that the tests of fmi-abi find, and a change without effect.
FAULTS = """
directory = "crates/fmi-abi/src"
tests = ["--package fmi-abi --lib"]

[[fault]]
name = "Pending is a status"
file = "status.rs"
old = "            4 => Self::Fatal,"
new = "            4 | 5 => Self::Fatal,"

[[fault]]
name = "a number is hexadecimal"
file = "status.rs"
old = "            4 => Self::Fatal,"
new = "            0x4 => Self::Fatal,"

[[fault]]
name = "a status has no name"
file = "status.rs"
old = "            4 => Self::Fatal,"
new = "            4 => Self::,"
"""


def run(*command: object, **environment: str) -> str:
    """Runs a program, which must succeed, in the project's directory. Returns its standard output."""
    words = [str(word) for word in command]
    done = subprocess.run(words, cwd=ROOT, env={**os.environ, **environment}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def rows(page: str) -> dict[str, list[float]]:
    """Returns the numbers in all rows of Markdown tables, by the label of the row. Rows with other cells are left out."""
    found = re.findall(r"^\| ([^|]+) \|((?: *[\d.,e+]+ \|)+)$", page, re.MULTILINE)
    return {label: [float(figure.replace(",", "")) for figure in figures.split("|")[:-1]] for label, figures in found}


@pytest.mark.long
@pytest.mark.skipif(platform.machine() != "x86_64", reason="the benchmarks use the library for linux64")
def test_the_benchmarks(fmu: Path) -> None:
    """One test, because the benchmarks share target/bench."""
    for name in ("prw_controller.fmu", "prw_closed_loop.ssp"):
        built(name)
    found = rows(run(sys.executable, "dev/benches/bench.py", fmu, BENCH_QUICK="1"))
    some = {"with use_omega and rates set", "memory of an instance / 4 KiB", "testbed", "8", "fmu_run, 2 threads"}
    assert some <= found.keys() and len(found) > 22
    assert all(figure > 0 for figures in found.values() for figure in figures), found


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the counts are for linux64")
@pytest.mark.parametrize("with_runs", [False, pytest.param(True, marks=pytest.mark.long)])
def test_no_use_takes_more_instructions_than_before(fmu: Path, with_runs: bool) -> None:
    """Fails also if a use takes fewer instructions, because the table would then hide a later rise."""
    if why := instructions.why_not_measurable():
        pytest.skip(why)
    table = json.loads(instructions.TABLE.read_text(encoding="utf-8"))["instructions"]
    if not with_runs:
        table = {use: count for use, count in table.items() if not use.startswith("fmu-run: ")}
    different = instructions.differences(instructions.measure(fmu, with_runs), table)
    assert not different, (
        "look for the cause; if the change is wanted, run `make instructions` and give the reason in the commit"
    )


def test_seeded_faults_fit_the_sources() -> None:
    written = sum(path.read_text(encoding="utf-8").count("\n[[") for path in (ROOT / "tests/faults").glob("*.toml"))
    assert f"{written} faults fit the sources" in run(sys.executable, "dev/tools/seeded_faults.py", "--check")


@pytest.mark.long
def test_seeded_faults_are_found_or_escape(tmp_path: Path) -> None:
    faults = tmp_path / "faults.toml"
    faults.write_text(FAULTS, encoding="utf-8")
    command = [sys.executable, "dev/tools/seeded_faults.py", str(faults)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 1 and "the next fault do not compile" in done.stderr
    assert done.stdout.splitlines() == [
        "found    Pending is a status",
        "escaped  a number is hexadecimal",
        "stale    a status has no name",
        "1 of 3 faults found",
    ]


def test_docs_are_written(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "dev/benches", tmp_path / "dev/benches")
    run(sys.executable, "dev/tools", "docs", "--project", tmp_path)
    path = performance.PAGE
    assert (tmp_path / path).read_bytes() == (ROOT / path).read_bytes(), f"{path} is stale: run `make docs`"


@pytest.mark.long
def test_figures_are_written(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Writes the files of `make figures`, but with two figures and short animations."""
    if shutil.which("chromium") is None:
        pytest.skip("chromium is not installed")
    built("prw_controller.fmu")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(animation, "SPEED", 20)
    monkeypatch.setattr(screencast, "GESTURES", ((1, False, (0, 0)), (1, True, (4, 0))))
    draw = plots.figures
    some = ("fig4_pair", "poles")
    monkeypatch.setattr(plots, "figures", lambda found: {k: v for k, v in draw(found).items() if k in some})
    (tmp_path / "docs").mkdir()
    assert (
        run_command("tools", "", {"figures": figures}, ["figures", "--fmu", str(fmu), "--out", "out", "--commit"]) == 0
    )
    written = {path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file() and "out" not in path.parts}
    assert len(written) == 5 and all((ROOT / path).is_file() for path in written)


def test_a_change_is_checked_where_it_is() -> None:
    """`make check` selects its commands by the changed files."""

    def lines(*names: str) -> str:
        return "\n".join(" ".join(command) for command in changed.commands(list(names)))

    assert "tests/prw/test_library.py" in lines("README.md") and "tests/publication" in lines("docs/checking.md")
    assert "ruff check dev/tools/changed.py" in lines("dev/tools/changed.py")
    assert "tests/prw" in lines("python/prw/src/prw/cli.py") and "tests/prw/test_readers.py" in lines(
        "tests/prw/test_readers.py"
    )
    model = lines("src/pair.rs", "crates/fmu-run/src/fmu.rs")
    assert "rdeps(=fmu-run) + rdeps(=prw_testbed)" in model and "build_fmu" in model
    assert "rdeps(=prw_testbed)" in lines("modelDescription/parameters.json")
    assert "rdeps(=fmu-check)" in lines("crates/fmu-check/src/a_deleted_file.rs")
    assert "build_fmu" not in lines("crates/fmu-run/src/fmu.rs")
    page = lines("docs/fmu-page/wrist/steps.js")
    assert "build_fmu" in page and "--no-page" not in page and "tests/fmpy/test_page.py" in page


def test_the_table_of_tests_names_what_exists() -> None:
    files = changed.git("ls-files")
    for pattern in (*changed.TESTS, *changed.PAGE):
        assert changed.matches(files, pattern), pattern
    for name in (*chain(*changed.TESTS.values()), *changed.CORE):
        assert (ROOT / name).exists(), name
