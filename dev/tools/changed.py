"""Checks the changes since the last commit, or the last commit if there are none; `make check`.

Runs the lints, then the tests of each changed crate and of the crates that use it, and the Python tests of what has
changed, without those that are long. If the FMU may have changed, it is built again, without its page, and its core
tests run. `make test` runs everything.
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
#: Clippy compiles the tests, as in the Makefile, and with the features of the whole workspace, so that nothing else is compiled again.
LINTED = ["--locked", "--workspace", "--config", 'build.rustc-workspace-wrapper="clippy-driver"']
#: Where the Python tests of a file are.
TESTS = {
    "python/prw/": ("tests/prw",),
    "python/prw/src/prw/identification": ("tests/analysis/test_identify.py", "tests/analysis/test_verdict.py"),
    "python/prw/src/prw/checking": ("tests/analysis/test_check.py",),
    "python/prw/src/prw/animation": ("tests/analysis/test_animation.py",),
    "python/prw/src/prw/sweeps": ("tests/analysis/test_sweep.py",),
    "crates/fmu-run/": ("tests/fmu_run",),
    "crates/fmu-check/": ("tests/check/test_file_limits.py",),
    "examples/": ("tests/examples",),
    "dev/tools/": ("tests/scripts",),
    "crates/fmu-package/page/": ("tests/fmpy/test_page.py",),
    ".github/": ("tests/publication",),
    "docs/": ("tests/publication",),
    "Makefile": ("tests/publication",),
}
#: Directory of the FMU that is built here. It has no page, so it must not replace the FMU of `make fmu`.
FMUS = ROOT / "target" / "check"
PYTEST = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n", "auto", "-m", "not long"]
SETTINGS = {"CLIPPY_ARGS": "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__"}
CORE = [f"tests/fmpy/test_{name}.py" for name in ("exactness", "description", "references")]


def changed_files() -> list[str]:
    """Paths from the root of the repository, also of deleted files."""

    def git(*arguments: str) -> list[str]:
        return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.split(
            "\n"
        )

    names = git("diff", "--name-only", "HEAD") + git("ls-files", "--others", "--exclude-standard")
    names = [name for name in names if name] or git("diff", "--name-only", "HEAD~1")
    return sorted({name for name in names if name})


def crate(name: str) -> str | None:
    """The Rust package that a file belongs to; None if it belongs to no package."""
    if name in ("build_fmu.rs", "Cargo.lock", "Cargo.toml"):
        return "build_fmu" if name.endswith(".rs") else "fmi-abi"
    if name.startswith(("src/", "tests/", "modelDescription/")):
        return "prw_testbed" if name.endswith((".rs", ".json")) else None
    for directory in (ROOT / name).parents:
        if directory != ROOT and (manifest := directory / "Cargo.toml").is_file():
            return str(tomllib.loads(manifest.read_text(encoding="utf-8"))["package"]["name"])
    return None


@cache
def of_the_fmu() -> set[str]:
    """The crates of the workspace that are linked into the FMU or that build it."""
    command = ["cargo", "tree", "--locked", "--edges", "normal,build", "--prefix", "none", "--format", "{p}"]
    command += ["--package", "prw_testbed", "--package", "build_fmu"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    return {line.split()[0] for line in printed.splitlines() if f"({ROOT}" in line}


def python_tests(names: list[str]) -> list[str]:
    """The directories and files of Python tests for these files, of which changed tests run themselves."""
    own = {name for name in names if name.startswith("tests/") and Path(name).name.startswith("test_")}
    helpers = {str(Path(name).parent) for name in names if name.startswith("tests/") and name.endswith(".py")} - {
        "tests"
    }
    of = {test for name in names for start, tests in TESTS.items() if name.startswith(start) for test in tests}
    found = of | {name for name in own if (ROOT / name).is_file()} | (helpers if not own else set())
    return sorted(found)


def commands(names: list[str]) -> list[list[str]]:
    """The commands that check these files."""
    rust = sorted({found for name in names if not name.endswith((".py", ".md")) and (found := crate(name))})
    scripts = [name for name in names if name.endswith(".py") and (ROOT / name).is_file()]
    tests = python_tests(names)
    listed: list[list[str]] = []
    if rust:
        users = " + ".join(f"rdeps(={name})" for name in rust)
        listed.append(["cargo", "fmt", "--all", "--check"])
        listed.append(["cargo", "test", *LINTED, "--all-targets", "--no-run", "--quiet"])
        listed.append(["cargo", "nextest", "run", *LINTED, "--profile", "quick", "-E", users])
    if scripts:
        listed.append([sys.executable, "-m", "ruff", "check", *scripts])
        listed.append([sys.executable, "-m", "ruff", "format", "--check", *scripts])
        listed.append([sys.executable, "-m", "mypy"])
    if rust and of_the_fmu().intersection(rust):
        listed.append(["cargo", "run", "--locked", "--bin", "build_fmu", "--", "--no-page", "--out", str(FMUS)])
        listed.append(["env", f"FMUS={FMUS}", *PYTEST, *CORE])
    if tests:
        listed.append([*PYTEST, *tests])
    return listed


def main() -> int:
    """Run the commands until one fails."""
    begin = time.monotonic()
    names = changed_files()
    print(f"{len(names)} changed files")
    for command in commands(names):
        shown = " ".join(Path(part).name if part == sys.executable else part for part in command)
        print(f"== {shown}", flush=True)
        if subprocess.run(command, cwd=ROOT, env={**os.environ, **SETTINGS}, check=False).returncode:
            print(f"failed: {shown}", file=sys.stderr)
            return 1
    print(f"checked in {time.monotonic() - begin:.0f} s; `make test` runs everything")
    return 0


if __name__ == "__main__":
    sys.exit(main())
