"""The GitHub workflows pass the linters and pin actions to commits. Crates have one source and allowed licences, and the files of
Python requirements have hashes and can be installed."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path

import pytest
from built import ROOT

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
#: Files in dev/requirements that contain hashes.
REQUIREMENTS = ["demo", "study", "tests", "importers", "examples", "release", "test-platforms", "uv"]
#: Requirements that must also be installable on Windows. A release is built on Linux and macOS.
EVERYWHERE = [name for name in REQUIREMENTS if name not in ("release", "test-platforms")]
OLDEST, NEWEST = "3.11", "3.14"
#: An action pinned to a commit, with its version as a comment.
PINNED = re.compile(r"uses: [\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+$")


def checked(program: str, *arguments: object) -> subprocess.CompletedProcess[str]:
    """Runs a linter of this environment."""
    command = [f"{sysconfig.get_path('scripts')}/{program}", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True)


def unpinned(workflow: str) -> list[str]:
    """Returns the lines that use an action without a pinned commit."""
    used = [line.strip() for line in workflow.splitlines() if re.search(r"\buses:", line)]
    return [line for line in used if not PINNED.search(line)]


def test_there_are_workflows() -> None:
    assert [path.name for path in WORKFLOWS] == ["dependencies.yml", "fmu.yml", "test.yml"]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_actionlint(path: Path) -> None:
    done = checked("actionlint", path)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_zizmor(path: Path) -> None:
    done = checked("zizmor", "--offline", path)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_linters_find_faults(tmp_path: Path) -> None:
    faulty = (
        (ROOT / ".github" / "workflows" / "fmu.yml")
        .read_text(encoding="utf-8")
        .replace("needs: release\n", "needs: relaese\n")
    )
    path = tmp_path / "fmu.yml"
    path.write_text(faulty.replace("contents: read", "contents: write"), encoding="utf-8")
    done = checked("actionlint", path)
    assert done.returncode and "relaese" in done.stdout
    done = checked("zizmor", "--offline", path)
    assert done.returncode and "excessive-permissions" in done.stdout


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.name)
def test_actions_are_commits(path: Path) -> None:
    assert unpinned(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("version", ["v7", "main", "3d3c42e # v7.0.1", "3d3c42e5aac5ba805825da76410c181273ba90b1"])
def test_unpinned_actions_are_found(version: str) -> None:
    assert unpinned(f"      - uses: actions/checkout@{version}") == [f"- uses: actions/checkout@{version}"]


def test_crates_come_from_one_registry_under_allowed_licences() -> None:
    rules = tomllib.loads((ROOT / "deny.toml").read_text(encoding="utf-8"))
    command = ["cargo", "metadata", "--locked", "--format-version", "1", "--all-features"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    allowed = set(rules["licenses"]["allow"])
    for crate in json.loads(done.stdout)["packages"]:
        assert crate["source"] in (None, f"registry+{rules['sources']['allow-registry'][0]}"), crate["name"]
        # Old crates write OR as a slash. Each part of an AND must be allowed.
        needed = crate["license"].replace("/", " OR ").replace("(", "").replace(")", "").split(" AND ")
        assert all(allowed & {one.strip() for one in part.split(" OR ")} for part in needed), crate["license"]


@pytest.mark.parametrize("name", REQUIREMENTS)
def test_python_requirements_have_hashes(name: str) -> None:
    content = (ROOT / "dev" / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
    entries = re.findall(r"^[^#\s-][^\\\n]*(?:\\\n[^\\\n]*)*", content, re.M)
    assert entries and all("==" in entry and "--hash=sha256:" in entry for entry in entries)


# The target directory is empty, because packages that are already installed would hide that the file lacks them.
@pytest.mark.parametrize(
    "name, version, platform",
    [(name, OLDEST, "linux") for name in REQUIREMENTS]
    + [(name, NEWEST, "macos") for name in REQUIREMENTS]
    + [(name, NEWEST, "windows") for name in EVERYWHERE],
)
def test_python_requirements_suffice_alone(name: str, version: str, platform: str, tmp_path: Path) -> None:
    uv = [sys.executable, "-m", "uv", "pip", "install", "--dry-run", "--require-hashes"]
    there = ["--python-version", version, "--python-platform", platform, "--target", str(tmp_path / "empty")]
    command = [*uv, *there, "-r", str(ROOT / "dev" / "requirements" / f"{name}.txt")]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def used_actions() -> set[tuple[str, str]]:
    """Returns the names and versions of all actions of the workflows."""
    return set(re.findall(r"uses: (\S+)@(.*)", "".join(path.read_text(encoding="utf-8") for path in WORKFLOWS)))


def test_an_action_has_one_version() -> None:
    used = used_actions()
    assert used and len(used) == len({name for name, _ in used})


@pytest.mark.parametrize("name", ["cargo-fmu", "fmu-check"])
def test_workflows_in_readmes(name: str, tmp_path: Path) -> None:
    """They pass the linter, and use the versions of actions that the workflows use."""
    page = (ROOT / "crates" / name / "README.md").read_text(encoding="utf-8")
    (workflow,) = re.findall(r"^```yaml\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    path = tmp_path / "workflow.yml"
    path.write_text(workflow, encoding="utf-8")
    done = checked("actionlint", path)
    assert done.returncode == 0, done.stdout + done.stderr
    major = {name: re.sub(r".* # (v\d+).*", r"\1", version) for name, version in used_actions()}
    for action, version in re.findall(r"uses: (\S+)@(\S+)", workflow):
        assert version == major.get(action, version), action
