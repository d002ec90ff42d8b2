"""Makes dist/ a second time, from a copy of the sources in another place, and compares: every byte must be the same."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from dist import DIST
from targets import ROOT

SUMS = "SHA256SUMS"


def copy_sources(copy: Path) -> Path:
    """Copies all that is in git, as it is now."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split("\0")
    for name in filter(None, names):
        if (ROOT / name).is_file():
            (copy / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, copy / name)
    return copy


def main() -> None:
    if not (DIST / SUMS).is_file():
        raise SystemExit(f"error: {DIST / SUMS} is missing; make it with `make dist`")
    with tempfile.TemporaryDirectory(prefix="rebuilt-") as folder:
        copy = copy_sources(Path(folder) / "sources")
        environment = {**os.environ, "CARGO_TARGET_DIR": str(Path(folder) / "target")}
        subprocess.run([sys.executable, copy / "platforms" / "dist.py"], cwd=copy, env=environment, check=True)
        ours, theirs = ((path / SUMS).read_text().splitlines() for path in (DIST, copy / "dist"))
    if ours != theirs:
        names = sorted({line.split("  ")[1] for line in set(ours) ^ set(theirs)})
        raise SystemExit(f"error: made twice, these differ: {', '.join(names)}")
    print(f"made twice, the same to the last byte: {', '.join(line.split('  ')[1] for line in ours)}")


if __name__ == "__main__":
    main()
