"""Builds the release again in a different environment and compares all bytes.

The source and target directories, the time zone, the locale and the umask differ.
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
    with tempfile.TemporaryDirectory(prefix="rebuilt-") as temporary:
        copy = Path(temporary) / "sources"
        os.umask(0o077)
        copy_sources(copy)
        others = {"CARGO_TARGET_DIR": str(Path(temporary) / "target"), "TZ": "Asia/Kolkata", "LC_ALL": "C"}
        command = [sys.executable, str(copy / "dev" / "platforms" / "release.py")]
        subprocess.run(command, cwd=copy, env={**os.environ, **others}, check=True)
        ours, theirs = (set((path / SUMS).read_text(encoding="utf-8").splitlines()) for path in (DIST, copy / "dist"))
        if ours != theirs:
            kept = ROOT / "target" / "rebuilt"
            shutil.rmtree(kept, ignore_errors=True)
            shutil.copytree(copy / "dist", kept)
            differing = sorted({line.split("  ")[1] for line in ours ^ theirs})
            raise SystemExit(f"error: these files differ in the second build, {kept}: {', '.join(differing)}")
    print(f"two builds are bit-identical: {len(ours)} files")


def copy_sources(destination: Path) -> None:
    """Copies the files that git tracks or would add."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            path = destination / name
            path.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, path)
            # git stores only whether a file is executable.
            path.chmod(0o700 if os.access(ROOT / name, os.X_OK) else 0o600)


if __name__ == "__main__":
    main()
