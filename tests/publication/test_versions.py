"""All files that repeat the version agree with `[workspace.package]` in Cargo.toml."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from built import ROOT
from test_readmes import FILES, PAGES


def read(path: Path | str) -> dict[str, Any]:
    return tomllib.loads((ROOT / path).read_text(encoding="utf-8"))


WORKSPACE = read("Cargo.toml")["workspace"]
VERSION: str = WORKSPACE["package"]["version"]


def own_packages() -> dict[str, Path]:
    """Returns the manifest of each package of the workspace."""
    manifests = [ROOT / member / "Cargo.toml" for member in (".", *WORKSPACE["members"])]
    return {read(manifest)["package"]["name"]: manifest for manifest in manifests}


def test_packages_have_this_version_and_require_it() -> None:
    tables = {"Cargo.toml": WORKSPACE["dependencies"]}
    for name, manifest in own_packages().items():
        content = read(manifest)
        assert content["package"]["version"] in ({"workspace": True}, VERSION), name
        for kind in ("dependencies", "dev-dependencies", "build-dependencies"):
            tables[f"{name}: {kind}"] = content.get(kind, {})
    asked = []
    for table, dependencies in tables.items():
        for name in own_packages().keys() & dependencies.keys():
            # A dependency without a version is left out when the package is published.
            asked.append(dependencies[name].get("version"))
            assert asked[-1] in (None, VERSION), f"{table}: {name}"
    assert VERSION in asked


def test_the_pages_name_the_oldest_rust() -> None:
    oldest = WORKSPACE["package"]["rust-version"]
    naming = set()
    for page in PAGES:
        versions = re.findall(r"\bRust(?:\]\([^)]*\))?(?: is)? (\d+\.\d+)", (ROOT / page).read_text(encoding="utf-8"))
        if versions and page != "CHANGELOG.md":
            assert set(versions) == {oldest}, page
            naming.add(page)
    assert naming >= {f"crates/{name}/README.md" for name in ("fmu-check", "fmu-export", "fmu-package", "fmu-run")}


def test_releases_are_compiled_with_an_exact_supported_rust() -> None:
    channel = read("dev/platforms/rust-toolchain.toml")["toolchain"]["channel"]
    assert re.fullmatch(r"\d+\.\d+\.\d+", channel)
    oldest = WORKSPACE["package"]["rust-version"]
    assert [int(part) for part in channel.split(".")] >= [int(part) for part in oldest.split(".")]
    # In the root, such a file would select the compiler of everybody.
    assert [name for name in FILES if "rust-toolchain" in name] == ["dev/platforms/rust-toolchain.toml"]


def test_lock_files_are_of_this_version() -> None:
    for lock in ("Cargo.lock", "crates/fmu-export/fuzz/Cargo.lock"):
        versions = {package["name"]: package["version"] for package in read(lock)["package"]}
        ours = own_packages().keys() & versions.keys()
        assert ours and all(versions[name] == VERSION for name in ours), f"run `cargo update --workspace` for {lock}"


def test_the_python_packages_have_this_version() -> None:
    prw = read("python/prw/pyproject.toml")["project"]
    assert prw["version"] == VERSION
    assert f"fmu-run~={VERSION}" in prw["dependencies"]
    # maturin takes the version from python/Cargo.toml.
    assert "version" in read("crates/fmu-run/pyproject.toml")["project"]["dynamic"]


def test_the_changelog_and_the_citation_have_this_version_and_its_date() -> None:
    """An unreleased version has no date."""
    changelog, citation = ((ROOT / name).read_text(encoding="utf-8") for name in ("CHANGELOG.md", "CITATION.cff"))
    headings = re.findall(r"^## (.*)$", changelog, re.MULTILINE)
    form = r"(\d+\.\d+\.\d+)(?: \((?:unreleased|(\d{4}-\d\d-\d\d))\))?"
    days = {match[1]: match[2] for heading in headings if (match := re.fullmatch(form, heading))}
    assert len(days) == len(headings), headings
    # Sections of later versions, which are unreleased, may be above.
    assert VERSION in days and all(days[version] is None for version in list(days)[: list(days).index(VERSION)])
    stated = dict(re.findall(r"^(version|date-released): (.*)$", citation, re.MULTILINE))
    assert stated == {"version": VERSION} | ({"date-released": days[VERSION]} if days[VERSION] else {})


def test_the_newest_section_of_the_changelog_is_in_groups() -> None:
    """Readers look first for changes that break their code, so each entry belongs to a group."""
    newest = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").split("\n## ")[1]
    before, *groups = re.split(r"^### (.*)$", newest, flags=re.MULTILINE)
    assert groups[::2] == [name for name in ("Breaking", "Added", "Changed", "Fixed") if name in groups]
    assert "*" not in before and all(re.match(r"\n\n(\*|\|) ", entries) for entries in groups[1::2])
