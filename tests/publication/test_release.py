"""The notes, the tag, the version and the Rust compiler of a release; dist/ keeps no file of an earlier release."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import prw_wheel
import pytest
import release

CHANGELOG = """# Changelog

## 0.2.0 (2026-02-03)

* New.

### Moving

Here is `## 0.1.0` within a line.

## 0.1.0 (2025-01-01)

* Old.
"""


def test_the_notes_are_the_section_of_the_version() -> None:
    assert release.release_notes(CHANGELOG, "0.2.0") == "* New.\n\n### Moving\n\nHere is `## 0.1.0` within a line.\n"
    assert release.release_notes(CHANGELOG, "0.1.0") == "* Old.\n"
    for version in ("0.2", "0.2.0-rc.1", "0.20.0", "1.0.0"):
        with pytest.raises(SystemExit, match=f"no heading that begins with '## {version}'"):
            release.release_notes(CHANGELOG, version)


def test_a_tag_names_the_dated_newest_version() -> None:
    release.check_tag("v0.2.0", CHANGELOG, "0.2.0")
    unreleased = CHANGELOG.replace("## 0.2.0", "## Unreleased\n\n* More.\n\n## 0.2.0")
    undated = CHANGELOG.replace(" (2026-02-03)", "")
    for tag, text, version in (
        ("v0.3.0", CHANGELOG, "0.2.0"),
        ("v0.2.0", unreleased, "0.2.0"),
        ("v0.2.0", undated, "0.2.0"),
        ("v0.1.0", CHANGELOG, "0.1.0"),
    ):
        with pytest.raises(SystemExit, match=f"expected are v{version} and '## {version} "):
            release.check_tag(tag, text, version)


def test_dist_keeps_no_file_of_an_earlier_release(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(release, "DIST", tmp_path / "dist")
    for version in ("0.1.0", "0.2.0"):
        made = tmp_path / "made" / version / "dist"
        made.mkdir(parents=True)
        (made / f"prw-{version}-py3-none-any.whl").write_text(version)
        (made / release.SUMS).write_text(release.checksums(made))
        release.put(made)
        names = [f"prw-{version}-py3-none-any.whl", release.SUMS]
        assert sorted(path.name for path in release.DIST.iterdir()) == sorted(names)
        assert (release.DIST / release.SUMS).read_text().endswith(f"  prw-{version}-py3-none-any.whl\n")


def test_a_different_version_of_prw_is_an_error() -> None:
    with pytest.raises(SystemExit, match=r"in python/prw/pyproject.toml is [\d.]+, in Cargo.toml it is 9.9.9"):
        prw_wheel.check_version("9.9.9")


RUST = release.RUST["channel"]
PARTS = ("src", "wasm32-unknown-unknown")


def install_rust(directory: Path, version: str, parts: tuple[str, ...]) -> None:
    """Writes a program `rustc` that answers like rustup's: it has this version only, with these parts of it."""
    for part in parts:
        (directory / "lib" / "rustlib" / part).mkdir(parents=True)
    rustc = directory / "rustc"
    rustc.write_text(
        f"""#!/bin/sh
[ "$RUSTUP_TOOLCHAIN" = {version} ] || {{ echo "toolchain '$RUSTUP_TOOLCHAIN' is not installed" >&2; exit 1; }}
case $1 in --version) echo 'rustc {version} (0123456 2026-01-01)';; --print=sysroot) echo '{directory}';; esac
"""
    )
    rustc.chmod(0o755)


@pytest.fixture
def only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A directory that is the only one in PATH."""
    for name in ("RUSTUP_TOOLCHAIN", "RUSTUP_AUTO_INSTALL"):
        monkeypatch.setenv(name, "")
    monkeypatch.setenv("PATH", str(tmp_path))
    return tmp_path


def test_a_release_is_compiled_with_one_version_of_rust(only: Path) -> None:
    install_rust(only, RUST, PARTS)
    release.select_rust()
    assert os.environ["RUSTUP_TOOLCHAIN"] == RUST
    assert subprocess.run(["rustc", "--version"], capture_output=True, text=True).stdout.startswith(f"rustc {RUST} ")


@pytest.mark.parametrize("version, parts", [("1.0.0", PARTS), (RUST, PARTS[:1]), (RUST, PARTS[1:])])
def test_another_or_an_incomplete_rust_is_an_error(version: str, parts: tuple[str, ...], only: Path) -> None:
    install_rust(only, version, parts)
    command = f"rustup toolchain install {RUST} --profile minimal --component rust-src --target wasm32-unknown-unknown"
    with pytest.raises(SystemExit, match=f"compiled with Rust {RUST}, .* missing or incomplete; .*: {command}$"):
        release.select_rust()
