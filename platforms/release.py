"""Makes dist/, all that a release has, or nothing: FMUs for all platforms and as C sources, the closed loop, reference
experiments, wheels, bills of materials, release notes, and the checksums of all of them.

    python platforms/release.py [--libraries FOLDER --wheels FOLDER]

The libraries and the wheels of fmu-run are compiled here, or taken from where other machines put them
(platforms/libraries.py, platforms/wheels.py).
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import tempfile
from pathlib import Path

import bill_of_materials
import fmus
import libraries
import prw_wheel
import release_notes
import wheels
from targets import MODEL, ROOT, TARGETS, WEBASSEMBLY

DIST = ROOT / "dist"
SUMS = "SHA256SUMS"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--libraries", type=Path, metavar="FOLDER")
    parser.add_argument("--wheels", type=Path, metavar="FOLDER")
    options = parser.parse_args()
    if (options.libraries is None) != (options.wheels is None):
        parser.error("--libraries and --wheels go together")
    # What takes no time comes first.
    version = release_notes.version()
    notes = release_notes.notes(release_notes.CHANGELOG.read_text(encoding="utf-8"), version)
    prw_wheel.check_version(version)
    bill_of_materials.check()
    source_compiler = fmus.source_compiler()

    (ROOT / "target").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=ROOT / "target", prefix="release-") as made:
        out, scratch = Path(made, "dist"), Path(made, "scratch")
        out.mkdir()
        scratch.mkdir()
        if options.libraries is None:
            options.libraries, options.wheels = scratch / "libraries", scratch / "wheels"
            libraries.compile_all(options.libraries, TARGETS)
            wheels.compile_all(options.wheels, TARGETS)
        fmus.make(options.libraries.resolve(), out, scratch)
        for wheel in wheels.found(options.wheels, version):
            shutil.copyfile(wheel, out / wheel.name)
        prw_wheel.build(out / f"{MODEL}.fmu", out)
        for product in bill_of_materials.PRODUCTS:
            shutil.copyfile(product.bill, out / f"{product.name}.cdx.json")
        (out / "RELEASE_NOTES.md").write_text(notes, encoding="utf-8")
        (out / "compilers.txt").write_text(compilers(options.libraries, source_compiler), encoding="utf-8")
        (out / SUMS).write_text(checksums(out), encoding="utf-8")
        put(out)
    for path in sorted(DIST.iterdir()):
        print(f"dist/{path.name}: {path.stat().st_size / 1000:.0f} kB")


def compilers(folder: Path, source_compiler: str) -> str:
    """What compiled the libraries for each target, and what made the C sources."""
    paths = sorted(folder.glob(f"*/{libraries.COMPILER}"))
    lines = [f"{path.parent.name}: {path.read_text(encoding='utf-8')}" for path in paths]
    return "".join([*lines, f"{WEBASSEMBLY.triple}: {source_compiler}\n"])


def checksums(folder: Path) -> str:
    """As `sha256sum --check` takes them."""
    files = sorted(path for path in folder.iterdir() if path.name != SUMS)
    return "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files)


def put(made: Path) -> None:
    """Makes this folder dist/, with nothing of what was there."""
    if DIST.exists():
        os.replace(DIST, made.with_name("previous"))
    os.replace(made, DIST)


if __name__ == "__main__":
    main()
