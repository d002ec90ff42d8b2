"""Makes the release a second time, as somebody else would, and compares: every byte must be the same.

Sources and target folder are elsewhere; the time zone, the language and the mask of new files are others, too.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from release import DIST, SUMS
from targets import ROOT


def main() -> None:
    if not (DIST / SUMS).is_file():
        raise SystemExit(f"error: {DIST / SUMS} is missing; make it with `make release`")
    ours = sums(DIST)
    with tempfile.TemporaryDirectory(prefix="rebuilt-") as folder:
        copy = Path(folder) / "sources"
        os.umask(0o077)
        copy_sources(copy)
        others = {"CARGO_TARGET_DIR": str(Path(folder) / "target"), "TZ": "Asia/Kolkata", "LC_ALL": "C"}
        command = [sys.executable, str(copy / "platforms" / "release.py")]
        subprocess.run(command, cwd=copy, env={**os.environ, **others}, check=True)
        theirs = sums(copy / "dist")
        # What differs can be looked at.
        differing = sorted(name for name in ours.keys() | theirs.keys() if ours.get(name) != theirs.get(name))
        kept = ROOT / "target" / "rebuilt"
        shutil.rmtree(kept, ignore_errors=True)
        if differing:
            shutil.copytree(copy / "dist", kept)
            raise SystemExit(f"error: made twice, these differ: {', '.join(differing)}; the second are in {kept}")
    print(f"made twice, the same to the last byte: {', '.join(ours)}")


def copy_sources(destination: Path) -> None:
    """Copies what git knows or would add."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            path = destination / name
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, path)
            # As git has it, of which all that counts is whether it can be executed.
            path.chmod(0o700 if os.access(ROOT / name, os.X_OK) else 0o600)


def sums(folder: Path) -> dict[str, str]:
    """The checksum of each file."""
    lines = (folder / SUMS).read_text(encoding="utf-8").splitlines()
    return {name: digest for digest, name in (line.split("  ") for line in lines)}


if __name__ == "__main__":
    main()
