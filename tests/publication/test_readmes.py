"""Links in READMEs and pages are valid, also in a published crate, and the manifests of published crates are complete."""

from __future__ import annotations

import re
import subprocess
import tomllib
from pathlib import Path

import pytest
from built import ROOT

from tools.documentation.sources import read_table

LISTED = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
FILES = [name for name in LISTED.split("\0") if name]
PAGES = [name for name in FILES if name.endswith(".md") or name in ("CITATION.cff",)]
#: Sites that pages may name: documentation and sources, but not package registries.
HOSTS = {"docs.rs", "github.com", "rustup.rs", "semver.org"}
#: Sentences that are no longer true after a release.
UNRELEASED = re.compile(r"not published yet|no download yet|no version has been published yet", re.IGNORECASE)
LINK = re.compile(r"\]\(<?([^)>\s]+)[^)]*\)|^\[[^\]]+\]:\s*(\S+)|(?:href|src)=\"([^\"]+)\"", re.MULTILINE)


def links(text: str) -> list[str]:
    """Returns the targets of a page's links and images, except those in code."""
    text = re.sub(r"^```.*?^```|`[^`\n]*`", "", text, flags=re.DOTALL | re.MULTILINE)
    return ["".join(found) for found in LINK.findall(text)]


def leads_out(page: Path, link: str, home: Path) -> bool:
    """Returns whether a relative link leads out of the published directory."""
    return not re.match(r"[a-z]+:|#", link) and not (page.parent / link).resolve().is_relative_to(home)


def published() -> list[Path]:
    """Returns the directories of the crates that are published."""
    manifests = [ROOT / name for name in FILES if name.endswith("Cargo.toml")]
    packages = {path: tomllib.loads(path.read_text(encoding="utf-8")).get("package", {}) for path in manifests}
    return [path.parent for path, package in packages.items() if package.get("publish", True)]


def released() -> bool:
    """Returns whether the newest section of the changelog has the date of a release."""
    newest = re.search(r"^## .*$", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    return newest is not None and re.search(r"\(\d", newest[0]) is not None


def test_links_are_found() -> None:
    text = '[a](b.md) `[c](d)` ![e](<f.png> "g") [h][i] <img src="k">\n\n[i]: ../j\n\n```\n[l](m)\n```\n'
    assert links(text) == ["b.md", "f.png", "k", "../j"]


def test_the_published_crates() -> None:
    names = {directory.name for directory in published()}
    assert names == {
        "fmi-abi",
        "fmi-client",
        "fmu-check",
        "fmu-export",
        "fmu-package",
        "fmu-run",
    }, "update this list, or add `publish = false` to a package that is not published"


@pytest.mark.parametrize("home", published(), ids=lambda directory: directory.name)
def test_the_page_of_a_crate_is_complete(home: Path) -> None:
    readme = home / "README.md"
    package = tomllib.loads((home / "Cargo.toml").read_text(encoding="utf-8"))["package"]
    # Manifests have no addresses, because the pages do not exist yet; the registry adds the address of the documentation itself.
    assert not {"documentation", "homepage", "repository"} & package.keys() and package["readme"] == readme.name
    assert package["description"] and 0 < len(package["keywords"]) <= 5 and package["categories"]
    for name in ("LICENSE-MIT", "LICENSE-APACHE"):
        assert (home / name).read_bytes() == (ROOT / name).read_bytes()
    found = links(readme.read_text(encoding="utf-8"))
    outside = [link for link in found if leads_out(readme, link, home)]
    assert not outside, f"{readme.relative_to(ROOT)} links out of the crate, which is read without the repository"
    # The page of the documentation is the README.
    code = next(path for path in (home / "src/lib.rs", home / "src/main.rs") if path.exists())
    assert code.read_text(encoding="utf-8").startswith('#![doc = include_str!("../README.md")]')
    assert ("not published yet" in readme.read_text(encoding="utf-8")) != released(), (
        f"{readme.relative_to(ROOT)}: state that the crate is not published only until it is released"
    )


def test_pages_state_that_nothing_is_published_only_until_the_release() -> None:
    texts = {name: " ".join((ROOT / name).read_text(encoding="utf-8").split()) for name in PAGES}
    found = {name for name, text in texts.items() if UNRELEASED.search(text)}
    if released():
        assert not found, "correct these pages, which state that nothing is published"
    else:
        assert found >= {"CHANGELOG.md", "README.md", "docs/author-guide.md", "python/prw/README.md"}


def anchors(page: Path) -> set[str]:
    """Returns the anchors of a page: ids, and in Markdown the headings as GitHub names them."""
    text = page.read_text(encoding="utf-8")
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE) if page.suffix == ".md" else []
    return {re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-") for heading in headings} | {
        *re.findall(r'\bid="([^"]+)"', text)
    }


@pytest.mark.parametrize("name", PAGES)
def test_relative_links_have_targets(name: str) -> None:
    page = ROOT / name
    for link in links(page.read_text(encoding="utf-8")):
        if not re.match(r"[a-z]+:", link):
            path, _, anchor = link.partition("#")
            target = page.parent / path if path else page
            assert target.exists() and (not anchor or anchor in anchors(target)), link


def test_the_marks_in_the_table_of_importers() -> None:
    """The table "At a glance" contains only the marks below, and each tool's name links to its section."""
    for tool, *marks in read_table(ROOT / "docs/compatibility.md", "At a glance").rows:
        assert re.fullmatch(r"\[[^\]]+\]\(#[\w-]+\)[\w .,-]{,20}", tool), tool
        assert set(marks) <= {"✓", "(✓)", "✗", "–", "?"}, tool


@pytest.mark.parametrize("name", PAGES)
def test_other_sites_are_documentation_or_sources(name: str) -> None:
    hosts = set(re.findall(r"https?://([\w.-]+)", (ROOT / name).read_text(encoding="utf-8")))
    assert hosts <= HOSTS, "add a new host to HOSTS, unless it is a package registry"


def test_the_release_notes_have_no_relative_links() -> None:
    """The release notes are copied from the changelog to other pages."""
    found = links((ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    assert all(link.startswith("https://") for link in found), found
