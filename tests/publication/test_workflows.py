"""The GitHub workflows, also those that READMEs show, pass the linters and pin actions to commits and tools to versions. Crates have one
source and allowed licences. Python packages are installed only with the hashes in dev/requirements.txt, which suffices for each group."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import sysconfig
import tomllib
from collections.abc import Iterable
from pathlib import Path

import pytest
from built import ROOT
from packaging.requirements import Requirement
from test_readmes import PAGES
from test_versions import read

WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
#: Actions in workflows that only READMEs show, so no workflow here determines their versions.
ONLY_SHOWN = {"github/codeql-action/upload-sarif"}
LOCK = ROOT / "dev" / "requirements.txt"
#: Options of uv, with which the Makefile installs packages.
LOCKED = ("--require-hashes", "--constraints", "dev/requirements.txt", "--excludes", "dev/own-packages.txt")
#: The packages that it installs with them.
PRW = ("-r", "python/prw/pyproject.toml", "--extra")
GROUPS: dict[str, tuple[str, ...]] = {"demo": (*PRW, "plot"), "study": (*PRW, "study")}
GROUPS |= {name: ("--group", name) for name in read("pyproject.toml")["dependency-groups"]}
#: Groups that must also be installable on Windows. A release is built on Linux and macOS.
EVERYWHERE = [name for name in GROUPS if name not in ("release", "test-platforms")]
OLDEST, NEWEST = "3.11", "3.14"
#: Prints the lines of the lock for uv.
BOOTSTRAP = r"sed -n '/^uv==/,/[^\\]$/p' dev/requirements.txt"
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


def locked(lock: str) -> dict[str, list[str]]:
    """Returns the lines for each package: its versions, for several versions of Python, with their hashes."""
    entries: dict[str, list[str]] = {}
    for entry in re.findall(r"^[^#\s-][^\\\n]*(?:\\\n[^\\\n]*)*\n", lock, re.MULTILINE):
        entries.setdefault(re.split(r"[=\s]", entry)[0], []).append(entry)
    return entries


def test_every_locked_package_has_hashes() -> None:
    entries = [entry for entries in locked(LOCK.read_text(encoding="utf-8")).values() for entry in entries]
    assert len(entries) > 100 and all("==" in entry and "--hash=sha256:" in entry for entry in entries)


def install(*options: object, lock: Path = LOCK) -> subprocess.CompletedProcess[str]:
    """Installs packages as the Makefile does."""
    locked = [lock if option == "dev/requirements.txt" else option for option in LOCKED]
    command = [str(word) for word in (sys.executable, "-m", "uv", "pip", "install", *locked, *options)]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True)


# The target directory is empty, because packages that are already installed would hide that the lock lacks them.
@pytest.mark.parametrize(
    "name, version, platform",
    [(name, OLDEST, "linux") for name in GROUPS]
    + [(name, NEWEST, "macos") for name in GROUPS]
    + [(name, NEWEST, "windows") for name in EVERYWHERE],
)
def test_the_lock_suffices(name: str, version: str, platform: str, tmp_path: Path) -> None:
    there = ("--python-version", version, "--python-platform", platform, "--target", tmp_path / "empty")
    done = install("--dry-run", *there, *GROUPS[name])
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", ["fmpy", "lxml"])
def test_a_package_without_hashes_is_an_error(name: str, tmp_path: Path) -> None:
    """The group names fmpy, which needs lxml."""
    lock = LOCK.read_text(encoding="utf-8")
    (entry,) = locked(lock)[name]
    for shortened in (lock.replace(entry, ""), lock.replace(entry, entry.partition(" ")[0] + "\n")):
        path = tmp_path / "lock.txt"
        path.write_text(shortened, encoding="utf-8")
        done = install("--dry-run", "--target", tmp_path / "empty", "--group", "elsewhere", lock=path)
        assert done.returncode and "hash" in done.stderr and name in done.stderr, done.stderr


def test_a_package_with_another_hash_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "lock.txt"
    lock = LOCK.read_text(encoding="utf-8")
    (entry,) = locked(lock)["lazy-loader"]
    path.write_text(lock.replace(entry, re.sub("(?<=sha256:).{8}", 8 * "0", entry)), encoding="utf-8")
    done = install("--target", tmp_path / "empty", "-r", "python/prw/pyproject.toml", lock=path)
    assert done.returncode and re.search("Hash mismatch for `?lazy-loader", done.stderr), done.stderr


def test_the_makefile_installs_every_group_with_hashes() -> None:
    """Only packages of this repository have no hashes. The installed tools build them, so nothing is downloaded."""
    stamps = [f".venv/{name}.stamp" for name in ("importers", "examples", "wasm2c")]
    stamps.append(".venv-dist/test-platforms.stamp")
    # `make test` starts this test; its MAKEFLAGS would change what the make below prints.
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
    command = ["make", "--dry-run", "--always-make", *stamps]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    commands = [line for line in done.stdout.splitlines() if re.search(r"\bpip install ", line)]
    hashed = [line for line in commands if "--require-hashes" in line]
    own = [line for line in commands if line not in hashed]
    assert own and all("--no-deps --no-build-isolation" in line for line in own), own
    packages = {line.partition(f" {' '.join(LOCKED)} ")[2] for line in hashed if BOOTSTRAP not in line}
    # The packages of `elsewhere` are only in the environments of tests/platforms.
    assert packages == {" ".join(options) for name, options in GROUPS.items() if name != "elsewhere"}


@pytest.mark.parametrize("name", ["Makefile", ".github/workflows/fmu.yml"])
def test_pip_installs_uv_from_the_lock(name: str) -> None:
    """pip cannot use a lock of all packages as constraints, so it gets the lines for uv."""
    commands = (ROOT / name).read_text(encoding="utf-8").replace("$$", "$").replace("$(LOCK)", "dev/requirements.txt")
    assert BOOTSTRAP in commands
    printed = subprocess.run(BOOTSTRAP, shell=True, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert [printed] == locked(LOCK.read_text(encoding="utf-8"))["uv"]


def test_the_lock_has_the_tools_that_build_the_packages() -> None:
    """They are installed before, so nothing else compares their versions with those that the packages require."""
    lock = locked(LOCK.read_text(encoding="utf-8"))
    for path in ("crates/fmu-check/pyproject.toml", "crates/fmu-run/pyproject.toml", "python/prw/pyproject.toml"):
        for required in map(Requirement, read(path)["build-system"]["requires"]):
            (entry,) = lock[required.name]
            assert required.specifier.contains(entry.split()[0].partition("==")[2]), path


def test_the_tools_of_workflows_have_exact_versions() -> None:
    lines = [line for path in WORKFLOWS for line in path.read_text(encoding="utf-8").splitlines()]
    installs = [found[0] for line in lines if (found := re.search(r"\b(?:cargo|pip) install .*", line))]
    cargo, pip = (
        r"cargo install --locked [\w-]+@\d+\.\d+\.\d+",
        r"[\w-]+==\d+\.\d+\.\d+|.*--require-hashes .*|--no-index .*",
    )
    pinned = re.compile(f"{cargo}|pip install ({pip})")
    assert len(installs) > 4 and [command for command in installs if not pinned.fullmatch(command)] == []
    # docs/releasing.md shows how to install one of them.
    page = (ROOT / "docs" / "releasing.md").read_text(encoding="utf-8")
    shown = re.findall(r"`(cargo install --locked [^`]*)`", page)
    assert shown and set(shown) <= {*installs}


def used_actions(workflows: Iterable[str]) -> set[tuple[str, str]]:
    """Returns the names of all actions of the workflows, with their commits and versions."""
    return set(re.findall(r"uses: (\S+)@(.*)", "\n".join(workflows)))


def own_actions() -> dict[str, str]:
    return dict(used_actions(path.read_text(encoding="utf-8") for path in WORKFLOWS))


def test_an_action_has_one_version() -> None:
    used = used_actions(path.read_text(encoding="utf-8") for path in WORKFLOWS)
    assert used and len(used) == len({name for name, _ in used})


def shown_workflows() -> dict[str, list[str]]:
    """Returns the workflows that pages show, by the names of the pages."""
    pages = {name: (ROOT / name).read_text(encoding="utf-8") for name in PAGES}
    blocks = {name: re.findall(r"^```yaml\n(.*?)^```", page, re.DOTALL | re.MULTILINE) for name, page in pages.items()}
    return {name: found for name in pages if (found := [block for block in blocks[name] if "uses:" in block])}


def test_pages_with_workflows_are_found() -> None:
    assert shown_workflows().keys() == {"crates/fmu-check/README.md", "crates/fmu-package/README.md"}
    # An action outside of these blocks would not be checked.
    for name in PAGES:
        page = (ROOT / name).read_text(encoding="utf-8")
        assert used_actions([page]) == used_actions(shown_workflows().get(name, [])), name


@pytest.mark.parametrize("name", shown_workflows())
def test_workflows_in_readmes(name: str, tmp_path: Path) -> None:
    """They pass the linter, and use the commits of actions that the workflows use."""
    own = own_actions()
    for workflow in shown_workflows()[name]:
        path = tmp_path / "workflow.yml"
        path.write_text(workflow, encoding="utf-8")
        done = checked("actionlint", path)
        assert done.returncode == 0, done.stdout + done.stderr
        assert unpinned(workflow) == []
        for action, commit in used_actions([workflow]):
            assert own[action] == commit if action not in ONLY_SHOWN else action not in own, action
