"""Makes the wheel of the Python package prw, with the FMU for all platforms inside: one wheel for all.

python platforms/prw_wheel.py [--out FOLDER] [--fmu FILE]
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from dist import DIST
from targets import MODEL, ROOT

PACKAGE = ROOT / "analysis"
LICENCES = ("LICENSE-MIT", "LICENSE-APACHE")
#: The first time that a zip can hold: the same sources give the same bytes.
EPOCH = "315532800"


def build(fmu: Path, out: Path) -> Path:
    """The wheel, in `out`."""
    with tempfile.TemporaryDirectory() as folder:
        copy, made = Path(folder, "sources"), Path(folder, "made")
        shutil.copytree(
            PACKAGE / "src", copy / "src", ignore=shutil.ignore_patterns("__pycache__", "*.egg-info", "fmu")
        )
        for path in (PACKAGE / "pyproject.toml", *(ROOT / name for name in LICENCES)):
            shutil.copy(path, copy)
        (copy / "src" / "prw" / "fmu").mkdir()
        shutil.copyfile(fmu, copy / "src" / "prw" / "fmu" / f"{MODEL}.fmu")
        command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", str(made), str(copy)]
        if subprocess.run(command, env={**os.environ, "SOURCE_DATE_EPOCH": EPOCH}).returncode:
            raise SystemExit("error: the wheel of prw could not be made; the messages are above")
        (wheel,) = made.iterdir()
        # Of earlier versions.
        for old in out.glob("prw-*.whl"):
            old.unlink()
        return Path(shutil.copyfile(wheel, out / wheel.name))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=DIST / "wheels", metavar="FOLDER")
    parser.add_argument("--fmu", type=Path, default=DIST / f"{MODEL}.fmu", metavar="FILE")
    options = parser.parse_args()
    if not options.fmu.is_file():
        raise SystemExit(f"error: {options.fmu} is missing; make it with `make dist`")
    options.out.mkdir(parents=True, exist_ok=True)
    wheel = build(options.fmu, options.out.resolve())
    print(f"{wheel.name}: {wheel.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
