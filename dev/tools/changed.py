"""Checks the changes since the last commit, or the last commit if there are none; `make check`.

Checks format and lints of the changed files, and runs the unit tests of the changed crates. If the FMU may have
changed, it is built again, without its page, and its core tests run. Tests of crates that use a changed crate, tests
in the directories `tests` of crates, documents, importers and C sources are left out; `make test` runs everything.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
import tomllib
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Tests of the testbed that compile no FMU.
QUICK = ("--lib", "--test", "paper", "--test", "stepping", "--test", "fmu")
#: Packages without unit tests in Rust.
UNTESTED = {"build_fmu", "fmu-run-python"}
#: Directory of the FMU that is built here. It has no page, so it must not replace the FMU of `make fmu`.
FMUS = ROOT / "target" / "check"
CORE = [f"tests/fmpy/test_{name}.py" for name in ("exactness", "description", "references")]


def changed_files() -> list[str]:
    """Paths from the root of the repository, without deleted ones."""

    def git(*arguments: str) -> list[str]:
        return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split(
            "\n"
        )

    names = git("diff", "--name-only", "HEAD") + git("ls-files", "--others", "--exclude-standard")
    names = [name for name in names if name] or git("diff", "--name-only", "HEAD~1")
    return sorted(name for name in set(names) if name and (ROOT / name).is_file())


def crate(name: str) -> str:
    """The Rust package that a file belongs to."""
    if name == "build_fmu.rs":
        return "build_fmu"
    for directory in (ROOT / name).parents:
        manifest = directory / "Cargo.toml"
        if manifest.is_file():
            return str(tomllib.loads(manifest.read_text(encoding="utf-8"))["package"]["name"])
    raise ValueError(f"{name} is outside of the repository")


@cache
def of_the_fmu() -> set[str]:
    """The crates of the workspace that are linked into the FMU or that build it."""
    command = ["cargo", "tree", "--locked", "--edges", "normal,build", "--prefix", "none", "--format", "{p}"]
    command += ["--package", "prw_testbed", "--package", "build_fmu"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return {line.split()[0] for line in printed.splitlines() if f"({ROOT}" in line}


def commands(names: list[str]) -> list[list[str]]:
    """The commands that check these files."""
    rust = sorted({crate(name) for name in names if name.endswith((".rs", "Cargo.toml"))})
    scripts = [name for name in names if name.endswith(".py")]
    listed: list[list[str]] = []
    if rust:
        packages = [argument for name in rust for argument in ("--package", name)]
        listed.append(["cargo", "fmt", "--all", "--check"])
        listed.append(["cargo", "clippy", "--locked", "--all-targets", *packages, "--", "-D", "warnings"])
        listed += [
            ["cargo", "test", "--locked", "--package", name, *(QUICK if name == "prw_testbed" else ("--lib",))]
            for name in rust
            if name not in UNTESTED
        ]
    if scripts:
        listed.append([sys.executable, "-m", "ruff", "check", *scripts])
        listed.append([sys.executable, "-m", "ruff", "format", "--check", *scripts])
        listed.append([sys.executable, "-m", "mypy"])
    if rust and of_the_fmu().intersection(rust):
        listed.append(["cargo", "run", "--locked", "--bin", "build_fmu", "--", "--no-page", "--out", str(FMUS)])
        listed.append([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n", "auto", *CORE])
    return listed


def main() -> int:
    """Run the commands until one fails."""
    begin = time.monotonic()
    names = changed_files()
    print(f"{len(names)} changed files")
    for command in commands(names):
        shown = " ".join(Path(part).name if part == sys.executable else part for part in command)
        print(f"== {shown}", flush=True)
        if subprocess.run(command, cwd=ROOT, env={**os.environ, "FMUS": str(FMUS)}, check=False).returncode:
            print(f"failed: {shown}", file=sys.stderr)
            return 1
    print(f"checked in {time.monotonic() - begin:.0f} s; `make test` runs everything")
    return 0


if __name__ == "__main__":
    sys.exit(main())
