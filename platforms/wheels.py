"""Makes the wheels of the Python package fmu-run: one for each platform, for every Python from 3.11 on.

python platforms/wheels.py [--out FOLDER] [TRIPLE...]
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from libraries import prepare
from targets import GLIBC, ROOT, TARGETS, Target, target
from toolchain import say

PACKAGE = ROOT / "crates" / "fmu-run"


def build(target: Target, out: Path) -> tuple[Path, str]:
    """The wheel and a line that says what compiled it."""
    toolchain, environment, glibc = prepare(target)
    with tempfile.TemporaryDirectory(dir=out) as made:
        command = [sys.executable, "-m", "maturin", "build", *toolchain.flags, "--target", target.triple, "--out", made]
        if glibc:
            command += ["--zig", "--compatibility", f"manylinux_{GLIBC.replace('.', '_')}"]
        if subprocess.run(command, cwd=PACKAGE, env=environment).returncode:
            raise SystemExit(f"error: the wheel for {target.triple} could not be made; the messages are above")
        (wheel,) = Path(made).iterdir()
        # Of earlier versions.
        for old in out.glob(f"fmu_run-*-{wheel.name.split('-', 2)[2]}"):
            old.unlink()
        return wheel.replace(out / wheel.name), toolchain.description


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=ROOT / "dist" / "wheels", metavar="FOLDER")
    parser.add_argument("triples", nargs="*", metavar="TRIPLE")
    options = parser.parse_args()
    targets = [target(triple) for triple in options.triples] or TARGETS
    options.out.mkdir(parents=True, exist_ok=True)
    for number, each in enumerate(targets, start=1):
        say(f"[{number}/{len(targets)}] {each.triple}")
        start = time.monotonic()
        wheel, compiled_by = build(each, options.out.resolve())
        say(f"      {compiled_by}, {time.monotonic() - start:.0f} s")
        print(f"{wheel.name}: {wheel.stat().st_size / 1000:.0f} kB", flush=True)


if __name__ == "__main__":
    main()
