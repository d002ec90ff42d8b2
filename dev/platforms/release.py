"""Builds the files of a release, and then replaces dist/ by them: FMUs for all platforms and as C sources, the closed
loop, reference experiments, wheels, third-party licences, bills of materials, release notes, and the checksums of all of them.

    python dev/platforms/release.py              builds dist/
    python dev/platforms/release.py --tag TAG    exits with an error unless TAG names the newest version in the changelog
"""

from __future__ import annotations

import hashlib
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

import bill_of_materials
import fmus
import libraries
import prw_wheel
from targets import MODEL, ROOT

DIST = ROOT / "dist"
SUMS = "SHA256SUMS"
CHANGELOG = ROOT / "CHANGELOG.md"
#: The Rust compiler of a release.
RUST: dict[str, Any] = tomllib.loads(Path(__file__).with_name("rust-toolchain.toml").read_text("utf-8"))["toolchain"]
#: The compilers, linkers and translators of a release.
VERSIONS = (("rustc", "--version"), ("python-zig", "version"), ("wasm2c", "--version"))


def main() -> None:
    version, changelog = cargo_version(), CHANGELOG.read_text(encoding="utf-8")
    notes = release_notes(changelog, version)
    if len(sys.argv) == 3 and sys.argv[1] == "--tag":
        return check_tag(sys.argv[2], changelog, version)
    # The checks that take no time come first.
    select_rust()
    prw_wheel.check_version(version)
    compilers = [
        f"{command[0]}: {libraries.run(*command, environment=libraries.environment())}\n" for command in VERSIONS
    ]

    (ROOT / "target").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=ROOT / "target", prefix="release-") as made:
        out, scratch = Path(made, "dist"), Path(made, "scratch")
        out.mkdir()
        scratch.mkdir()
        bill_of_materials.write(out, version)
        fmus.make(libraries.compile_all(out), out, scratch)
        prw_wheel.build(out / f"{MODEL}.fmu", out)
        (out / "RELEASE_NOTES.md").write_text(notes, encoding="utf-8")
        (out / "compilers.txt").write_text("".join(compilers), encoding="utf-8")
        (out / SUMS).write_text(checksums(out), encoding="utf-8")
        put(out)
    for path in sorted(DIST.iterdir()):
        print(f"dist/{path.name}: {path.stat().st_size / 1000:.0f} kB")


def select_rust() -> None:
    """Selects the Rust compiler of a release for all programs that this one starts. Exits if it is missing, or a part of it."""
    # Without the second variable, rustup might download the compiler, but not all of its parts.
    os.environ |= {"RUSTUP_TOOLCHAIN": RUST["channel"], "RUSTUP_AUTO_INSTALL": "0"}
    version, sysroot = (
        subprocess.run(["rustc", option], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout.strip()
        for option in ("--version", "--print=sysroot")
    )
    # The component rust-src is in lib/rustlib/src, the library for a target in a directory with the name of the target.
    parts = [name.removeprefix("rust-") for name in RUST["components"]] + RUST["targets"]
    installed = all((Path(sysroot) / "lib" / "rustlib" / part).is_dir() for part in parts)
    if not version.startswith(f"rustc {RUST['channel']} ") or not installed:
        options = [f"--profile {RUST['profile']}", *(f"--component {name}" for name in RUST["components"])]
        options += [f"--target {name}" for name in RUST["targets"]]
        raise SystemExit(
            f"error: releases are compiled with Rust {RUST['channel']}, which is missing or incomplete; install it with: "
            f"rustup toolchain install {RUST['channel']} {' '.join(options)}"
        )


def cargo_version() -> str:
    """Returns the version of all packages."""
    workspace = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["workspace"]
    return str(workspace["package"]["version"])


def release_notes(changelog: str, version: str) -> str:
    """Returns the section of this version in the changelog, without its heading."""
    found = re.search(rf"^## {re.escape(version)}(?![\w.-]).*\n((?:(?!## ).*\n)*)", changelog, re.MULTILINE)
    if found is None:
        raise SystemExit(
            f"error: CHANGELOG.md has no heading that begins with '## {version}', the version in Cargo.toml"
        )
    return f"{found[1].strip()}\n"


def check_tag(tag: str, changelog: str, version: str) -> None:
    """Exits unless the tag, the version in Cargo.toml and the dated newest section of the changelog agree."""
    newest = re.findall(r"^## .*", changelog, re.MULTILINE)[0]
    if tag != f"v{version}" or not re.fullmatch(rf"## {re.escape(version)} \(\d{{4}}-\d\d-\d\d\)", newest):
        raise SystemExit(
            f"error: the tag is {tag}, the version in Cargo.toml is {version}, and the changelog begins with '{newest}'; "
            f"expected are v{version} and '## {version} (YYYY-MM-DD)'"
        )


def checksums(directory: Path) -> str:
    """Returns the input of `sha256sum --check`."""
    files = sorted(path for path in directory.iterdir() if path.name != SUMS)
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files)


def put(made: Path) -> None:
    """Replaces dist/ by this directory."""
    if DIST.exists():
        os.replace(DIST, made.with_name("previous"))
    os.replace(made, DIST)


if __name__ == "__main__":
    main()
