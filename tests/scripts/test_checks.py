"""`make check` selects commands by the changed files. `make check-release` has all targets that check something."""

from __future__ import annotations

import re
import subprocess
import sys

from built import ROOT

from tools import changed, release_check

#: Targets that check nothing, or whose checks another target contains.
NO_PARTS = {
    "help", "demo", "demo-fmu", "check", "check-release", "fmu", "closed-loop", "release", "source-fmu", "study", "examples", "clean",
    "test-rust", "test-python", "test-fmu", "test-closed-loop", "test-importers", "test-examples", "reference",
}  # fmt: skip


def test_every_target_is_a_part_of_the_release_check() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    shown = set(re.findall(r"^\t@echo 'make ([\w-]+)", makefile, re.MULTILINE))
    assert {arguments[0] for arguments in release_check.PARTS.values()} == shown - NO_PARTS


def test_an_unknown_part_is_named() -> None:
    command = [sys.executable, "dev/tools/release_check.py", "tests"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 2 and "no part has the target tests; choose from test," in done.stderr


def test_every_crate_of_the_fmu_builds_it_again() -> None:
    """The crates of the workspace that are linked into the FMU or that build it, according to cargo."""
    command = ["cargo", "tree", "--locked", "--edges", "normal,build", "--prefix", "none", "--format", "{p}"]
    packages = ["--package", "prw_testbed", "--package", "build_fmu"]
    printed = subprocess.run([*command, *packages], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert {line.split()[0] for line in printed.splitlines() if f"({ROOT}" in line} == changed.OF_THE_FMU


def test_a_change_is_checked_where_it_is() -> None:
    def lines(*names: str) -> list[str]:
        return [" ".join(command[command[0] == sys.executable :]) for command in changed.commands(list(names))]

    assert lines("docs/checking.md") == []
    assert lines("dev/tools/changed.py")[0] == "-m ruff check dev/tools/changed.py"
    model = lines("src/pair.rs", "crates/fmu-run/src/fmu.rs")
    assert any("clippy" in line and "--package fmu-run --package prw_testbed" in line for line in model)
    assert any("--package fmu-run --lib" in line for line in model)
    assert any("--test stepping" in line for line in model) and any("build_fmu" in line for line in model)
    assert not any("build_fmu" in line for line in lines("crates/fmu-run/src/fmu.rs"))
