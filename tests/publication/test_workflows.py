"""The workflows pass actionlint and zizmor, also those that READMEs show, and the lock suffices for every environment."""

from __future__ import annotations

import re
import subprocess
import sys
import sysconfig
from pathlib import Path

import pytest
from built import ROOT
from repository import FILES, PAGES, manifest, text

WORKFLOWS = [name for name in FILES if re.fullmatch(r"\.github/workflows/.*\.yml", name)]
SHOWN = [
    block
    for page in PAGES
    for block in re.findall(r"^```yaml\n(.*?)^```", text(page), re.DOTALL | re.MULTILINE)
    if "uses:" in block
]


def lint(program: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs a linter of this environment."""
    command = [f"{sysconfig.get_path('scripts')}/{program}", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


def test_workflows_pass_the_linters(tmp_path: Path) -> None:
    shown = [tmp_path / f"{number}.yml" for number in range(len(SHOWN))]
    for path, workflow in zip(shown, SHOWN):
        path.write_text(workflow, encoding="utf-8")
    for command in (("actionlint", *WORKFLOWS, *shown), ("zizmor", "--offline", *WORKFLOWS)):
        done = lint(*command)
        assert WORKFLOWS and SHOWN and done.returncode == 0, done.stdout + done.stderr


def test_an_action_has_one_version() -> None:
    used = set(re.findall(r"uses: (\S+)@(.*)", "\n".join([*map(text, WORKFLOWS), *SHOWN])))
    assert used and len(used) == len({name for name, _ in used})


def test_every_target_of_the_makefile_runs_in_a_workflow() -> None:
    """A workflow names the target, as a command or as a part of `make check-release`, or a target that it names needs it."""
    database = subprocess.run(["make", "-npq"], cwd=ROOT, capture_output=True, text=True).stdout.replace("\\\n", "")
    (phony,) = re.findall(r"^\.PHONY: (.*)$", database, re.M)
    targets = set(phony.split())
    # The prerequisites, and the targets that a recipe passes to another make.
    needs = {
        name: {word for word in re.sub(r"^(\t(?!.*\$\(MAKE\))|#).*\n", "", rule, flags=re.M).split() if word in targets}
        for name, rule in re.findall(r"^([\w-]+):(.*\n(?:\t.*\n|#.*\n)*)", database, re.M)
    }
    named = re.sub(r"^ *#.*", "", "\n".join([*map(text, WORKFLOWS), text(".ci/run")]), flags=re.M)
    reached: set[str] = set()
    waiting = {word for line in re.findall(r"\bmake ([\w =-]+)", named) for word in re.split("[ =]", line)} & targets
    waiting |= {name for name in re.findall(r"^ +- ([\w-]+)$", named, re.M) if name in targets}
    while waiting:
        reached |= waiting
        waiting = {need for name in waiting for need in needs[name]} - reached
    assert targets - reached == set()


@pytest.mark.parametrize(("python", "platform"), [("3.11", "linux"), ("3.14", "macos"), ("3.14", "windows")])
def test_the_lock_has_the_hash_of_every_package(python: str, platform: str, tmp_path: Path) -> None:
    """A release is built on Linux and macOS only. The directory is empty, so no installed package hides that the lock lacks it."""
    groups = manifest("pyproject.toml")["dependency-groups"].keys()
    if platform == "windows":
        groups -= {"release", "test-platforms"}
    command = [sys.executable, "-m", "uv", "pip", "install", "--dry-run", "--require-hashes"]
    command += ["--constraints", "dev/requirements.txt", "--excludes", "dev/own-packages.txt"]
    command += ["--python-version", python, "--python-platform", platform, "--target", str(tmp_path)]
    command += [
        "-r",
        "python/prw/pyproject.toml",
        "--all-extras",
        *(word for name in sorted(groups) for word in ("--group", name)),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
