"""A release says what the changelog says of its version, and a tag names that version."""

from __future__ import annotations

import pytest
from release_notes import check_tag, notes

TEXT = """# Changelog

Newest first.

## 0.2.0 (2026-02-03)

* New.

### Moving

Here is `## 0.1.0` within a line.

## 0.1.0 (2025-01-01)

* Old.
"""


def test_the_section_of_a_version() -> None:
    assert notes(TEXT, "0.2.0") == "* New.\n\n### Moving\n\nHere is `## 0.1.0` within a line.\n"
    assert notes(TEXT, "0.1.0") == "* Old.\n"


@pytest.mark.parametrize("version", ["0.2", "0.2.0-rc.1", "0.20.0", "1.0.0"])
def test_no_section(version: str) -> None:
    with pytest.raises(SystemExit, match=f"no section for {version}, the version in Cargo.toml.*## {version}"):
        notes(TEXT, version)


def test_the_tag_is_the_version() -> None:
    check_tag("v0.2.0", TEXT, "0.2.0")
    with pytest.raises(SystemExit, match="the tag is v0.3.0, but the version in Cargo.toml is 0.2.0"):
        check_tag("v0.3.0", TEXT, "0.2.0")


def test_what_changed_since_is_not_left_out() -> None:
    with pytest.raises(SystemExit, match="has '## Unreleased' above 0.2.0"):
        check_tag("v0.2.0", TEXT.replace("## 0.2.0", "## Unreleased\n\n* More.\n\n## 0.2.0"), "0.2.0")


def test_what_is_released_has_a_day() -> None:
    with pytest.raises(SystemExit, match=r"has no date in '## 0.2.0'; write '## 0.2.0 \(YYYY-MM-DD\)'"):
        check_tag("v0.2.0", TEXT.replace("## 0.2.0 (2026-02-03)", "## 0.2.0"), "0.2.0")
