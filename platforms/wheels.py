"""Makes the wheels of the Python package fmu-run: one for each platform, for every Python from 3.11 on.

python platforms/wheels.py FOLDER TRIPLE...
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from libraries import prepare
from targets import GLIBC, ROOT, TARGETS, Target, target
from toolchain import say

PACKAGE = ROOT / "crates" / "fmu-run"


def build(target: Target, out: Path) -> Path:
    """The wheel for a target, in `out`."""
    toolchain, environment, glibc = prepare(target)
    with tempfile.TemporaryDirectory(dir=out) as made:
        command = [
            sys.executable,
            "-m",
            "maturin",
            "build",
            "--profile",
            "library",
            *toolchain.flags,
            "--target",
            target.triple,
            "--out",
            made,
        ]
        if glibc:
            command += ["--zig", "--compatibility", f"manylinux_{GLIBC.replace('.', '_')}"]
        if subprocess.run(command, cwd=PACKAGE, env=environment).returncode:
            raise SystemExit(f"error: the wheel for {target.triple} could not be made; the messages are above")
        (wheel,) = Path(made).iterdir()
        return wheel.replace(out / wheel.name)


def compile_all(out: Path, targets: Sequence[Target]) -> None:
    """Puts the wheels for these targets in a folder."""
    out.mkdir(parents=True, exist_ok=True)
    for number, each in enumerate(targets, start=1):
        say(f"[{number}/{len(targets)}] wheel for {each.triple}")
        start = time.monotonic()
        wheel = build(each, out.resolve())
        say(f"      {wheel.name}: {wheel.stat().st_size / 1000:.0f} kB, {time.monotonic() - start:.0f} s")


def found(folder: Path, version: str) -> list[Path]:
    """The wheels of this version in a folder, one for each target."""
    wheels = []
    for each in TARGETS:
        paths = sorted(folder.glob(f"fmu_run-{version}-*{each.wheel}*.whl"))
        if len(paths) != 1:
            raise SystemExit(
                f"error: {folder} must have one wheel of fmu-run {version} for {each.wheel}, not {len(paths)}"
            )
        wheels += paths
    return wheels


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    compile_all(Path(sys.argv[1]), [target(triple) for triple in sys.argv[2:]])
