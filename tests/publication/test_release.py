"""The notes and the tag of a release."""

from __future__ import annotations

import pytest
import release

CHANGELOG = """# Changelog

## 0.2.0 (2026-02-03)

* New.

Here is `## 0.1.0` within a line.

## 0.1.0 (2025-01-01)

* Old.
"""


def test_the_notes_are_the_section_of_the_version() -> None:
    assert release.release_notes(CHANGELOG, "0.2.0") == "* New.\n\nHere is `## 0.1.0` within a line.\n"
    assert release.release_notes(CHANGELOG, "0.1.0") == "* Old.\n"
    with pytest.raises(SystemExit, match="no heading that begins with '## 0.2'"):
        release.release_notes(CHANGELOG, "0.2")


@pytest.mark.parametrize(
    ("tag", "old", "new", "version"),
    [
        ("v0.3.0", "", "", "0.2.0"),
        ("v0.2.0", "## 0.2.0", "## Unreleased\n\n* More.\n\n## 0.2.0", "0.2.0"),
        ("v0.2.0", " (2026-02-03)", "", "0.2.0"),
        ("v0.1.0", "", "", "0.1.0"),
    ],
)
def test_a_tag_names_the_dated_newest_version(tag: str, old: str, new: str, version: str) -> None:
    release.check_tag("v0.2.0", CHANGELOG, "0.2.0")
    with pytest.raises(SystemExit, match=f"expected are v{version} and '## {version} "):
        release.check_tag(tag, CHANGELOG.replace(old, new), version)
