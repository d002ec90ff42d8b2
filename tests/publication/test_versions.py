"""The version stands in Cargo.toml's `[workspace.package]`; the places that must repeat it say the same."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

from built import ROOT


def tracked(pattern: str) -> list[Path]:
    """The project's own files, not those of its build folders."""
    listed = subprocess.run(["git", "ls-files", "-z", pattern], cwd=ROOT, capture_output=True, text=True, check=True)
    found = [ROOT / name for name in listed.stdout.split("\0") if name]
    assert found, pattern
    return found


def read(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


WORKSPACE = read(ROOT / "Cargo.toml")["workspace"]
VERSION: str = WORKSPACE["package"]["version"]


def own_packages() -> dict[str, Path]:
    """The workspace's packages, each with its manifest."""
    manifests = [ROOT / "Cargo.toml", *(ROOT / member / "Cargo.toml" for member in WORKSPACE["members"])]
    return {read(manifest)["package"]["name"]: manifest for manifest in manifests}


def test_every_package_has_the_version_of_the_workspace() -> None:
    for name, manifest in own_packages().items():
        assert read(manifest)["package"]["version"] in ({"workspace": True}, VERSION), name


def test_packages_ask_for_each_other_in_this_version() -> None:
    tables = {"Cargo.toml": WORKSPACE["dependencies"]}
    for manifest in own_packages().values():
        for kind in ("dependencies", "dev-dependencies", "build-dependencies"):
            tables[f"{manifest.relative_to(ROOT)}: {kind}"] = read(manifest).get(kind, {})
    asked = 0
    for table, dependencies in tables.items():
        for name in own_packages().keys() & dependencies.keys():
            version = dependencies[name].get("version")
            # Without a version, the dependency is not published with the package.
            assert version in (None, VERSION), f"{table}: {name}"
            asked += version is not None
    assert asked


def test_lock_files_are_of_this_version() -> None:
    for lock in tracked("*Cargo.lock"):
        versions = {package["name"]: package["version"] for package in read(lock)["package"]}
        ours = own_packages().keys() & versions.keys()
        assert ours and all(versions[name] == VERSION for name in ours), (
            f"{lock.relative_to(ROOT)} is out of date; `cargo update --workspace` there writes it anew"
        )


def test_the_python_packages_have_this_version() -> None:
    prw = read(ROOT / "python/prw/pyproject.toml")["project"]
    assert prw["version"] == VERSION
    assert f"fmu-run~={VERSION}" in prw["dependencies"]
    # It takes that of python/Cargo.toml.
    assert "version" in read(ROOT / "crates/fmu-run/pyproject.toml")["project"]["dynamic"]


def test_descriptions_have_this_version() -> None:
    ours = [path for path in tracked("*modelDescription.xml") if "fmu-package" in path.read_text(encoding="utf-8")]
    assert len(ours) == 2
    for description in ours:
        text = description.read_text(encoding="utf-8")
        said = [*re.findall(r'^  version="(.*)"', text, re.MULTILINE), *re.findall(r'"fmu-package (.*)"', text)]
        assert said == [VERSION, VERSION], f"{description.relative_to(ROOT)} is out of date; run `make docs`"


def test_the_citation_is_of_this_version_and_its_day() -> None:
    """The day is that of the release, and what is not released yet has none."""
    changelog, citation = ((ROOT / name).read_text(encoding="utf-8") for name in ("CHANGELOG.md", "CITATION.cff"))
    said = dict(re.findall(r"^(version|date-released): (.*)$", citation, re.MULTILINE))
    (day,) = re.findall(rf"^## {re.escape(VERSION)}(?: \((?:unreleased|(.*))\))?$", changelog, re.MULTILINE)
    assert said == {"version": VERSION} | ({"date-released": day} if day else {})


def test_the_changelog_begins_with_this_version() -> None:
    """What a release says of itself is cut out of the changelog by these headings."""
    headings = re.findall(r"^## (.*)$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert all(re.fullmatch(r"\d+\.\d+\.\d+( \((\d{4}-\d\d-\d\d|unreleased)\))?", name) for name in headings), headings
    newest = [heading for heading in headings if not heading.endswith("(unreleased)") or heading.startswith(VERSION)]
    assert newest[0].split()[0] == VERSION
