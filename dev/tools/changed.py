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
from fnmatch import fnmatch
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Clippy compiles the tests, as in the Makefile, and with the features of the whole workspace, so that nothing else is compiled again.
LINTED = ["--locked", "--workspace", "--config", 'build.rustc-workspace-wrapper="clippy-driver"']
#: Which Python tests read the files that match a pattern, or test what they are for.
TESTS = {
    "*.md": ("tests/publication",),
    "*.yml": ("tests/publication",),
    "Makefile": ("tests/publication",),
    "pyproject.toml": ("tests/publication",),
    "README.md": ("tests/prw/test_library.py",),
    "crates/fmu-run/*": ("tests/fmu_run",),
    "crates/fmu-check/*": ("tests/check/test_file_limits.py",),
    "dev/*.py": ("tests/scripts",),
    "dev/benches/*.json": ("tests/scripts",),
    "docs/examples*": ("tests/examples",),
    "examples/*.py": ("tests/examples",),
    "python/prw/*.md": ("tests/prw/test_library.py", "tests/analysis/test_tutorial.py"),
    "python/prw/src/*": ("tests/prw",),
    "python/prw/src/prw/animation.py": ("tests/analysis/test_animation.py",),
    "python/prw/src/prw/checking/*": ("tests/analysis/test_check.py",),
    "python/prw/src/prw/identification/*": ("tests/analysis/test_identify.py", "tests/analysis/test_verdict.py"),
    "python/prw/src/prw/sweeps.py": ("tests/analysis/test_sweep.py",),
    "tests/oracle/*": ("tests/oracle",),
}
#: What the page in the FMU is put together from.
PAGE = ("crates/fmu-package/page/*", "crates/fmu-package/src/page*", "dev/prw_page/*", "docs/fmu-page/*")
#: Directory of the FMU that is built here. It has no page, so it must not replace the FMU of `make fmu`.
FMUS = ROOT / "target" / "check"
PYTEST = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-n", "auto", "-m", "not long"]
SETTINGS = {"CLIPPY_ARGS": "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__"}
CORE = [f"tests/fmpy/test_{name}.py" for name in ("exactness", "description", "references")]


def git(*arguments: str) -> list[str]:
    """The lines that git prints."""
    return subprocess.run(["git", *arguments], cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines()


def changed_files() -> list[str]:
    """Paths from the root of the repository, also of deleted files."""
    names = git("diff", "--name-only", "HEAD") + git("ls-files", "--others", "--exclude-standard")
    return sorted(set(names or git("diff", "--name-only", "HEAD~1")))


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


def matches(names: list[str], *patterns: str) -> bool:
    """Whether one of the files matches one of the patterns, in which a star also matches slashes."""
    return any(fnmatch(name, pattern) for name in names for pattern in patterns)


def python_tests(names: list[str]) -> list[str]:
    """The directories and files of Python tests for these files. Changed tests run themselves. If only a module that tests import has
    changed, the tests in its directory run."""
    tests = [name for name in names if fnmatch(name, "tests/*.py")]
    own = {name for name in tests if Path(name).name.startswith("test_")}
    helped = {str(Path(name).parent) for name in tests} - {"tests"} if not own else set()
    found = {test for pattern, listed in TESTS.items() if matches(names, pattern) for test in listed}
    return sorted(found | helped | {name for name in own if (ROOT / name).is_file()})


def commands(names: list[str]) -> list[list[str]]:
    """The commands that check these files."""
    rust = sorted({found for name in names if not name.endswith((".py", ".md")) and (found := crate(name))})
    scripts = [name for name in names if name.endswith(".py") and (ROOT / name).is_file()]
    has_page = matches(names, *PAGE)
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
    if has_page or of_the_fmu().intersection(rust):
        page = [] if has_page else ["--no-page"]
        listed.append(["cargo", "run", "--locked", "--bin", "build_fmu", "--", *page, "--out", str(FMUS)])
        listed.append(["env", f"FMUS={FMUS}", *PYTEST, *CORE, *(["tests/fmpy/test_page.py"] if has_page else [])])
    if tests := python_tests(names):
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
