"""Makes dist/: the FMUs for all platforms, for FMI 2.0 and FMI 3.0, the FMU of FMI 2.0 for importers on ARM Linux,
reference experiments for other tools, checksums, bill of materials.

    python platforms/dist.py [--libraries FOLDER]

With --libraries, FOLDER/TRIPLE/LIBRARY is taken as another machine compiled it (platforms/libraries.py).
"""

from __future__ import annotations

import argparse
import hashlib
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import bill_of_materials
import cross_check
from libraries import compile_library, universal
from targets import ARM_FOLDERS, FMI3_FOLDERS, FOLDERS, MODEL, NATIVE_WINDOWS, ROOT, TARGETS, WINDOWS, Target
from toolchain import say

DIST = ROOT / "dist"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--libraries", type=Path, metavar="FOLDER")
    options = parser.parse_args()
    bill_of_materials.check()
    libraries, compilers = compiled_elsewhere(options.libraries) if options.libraries else compile_all()

    (ROOT / "target").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(dir=ROOT / "target") as made:
        folder = Path(made)
        pack(folder, 2, FOLDERS, libraries)
        pack(folder / "arm", 2, ARM_FOLDERS, libraries, "--any-processor")
        (folder / "arm" / f"{MODEL}.fmu").rename(folder / f"{MODEL}-linux-arm64.fmu")
        pack(folder, 3, FMI3_FOLDERS, libraries)
        (folder / "fmi3" / f"{MODEL}.fmu").rename(folder / f"{MODEL}-fmi3.fmu")
        cross_check.pack(folder / f"{MODEL}.fmu", folder / f"{MODEL}-cross-check.zip")
        bill = bill_of_materials.FMU.bill
        shutil.copyfile(bill, folder / bill.name)
        if compilers:
            (folder / "compilers.txt").write_text("".join(f"{line}\n" for line in compilers), encoding="utf-8")
        files = sorted(path for path in folder.iterdir() if path.is_file() and path.suffix != ".dylib")
        sums = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in files]
        (folder / "SHA256SUMS").write_text("".join(sums), encoding="utf-8")
        DIST.mkdir(exist_ok=True)
        for path in (*files, folder / "SHA256SUMS"):
            os.replace(path, DIST / path.name)
            print(f"dist/{path.name}: {(DIST / path.name).stat().st_size / 1000:.0f} kB")


def compile_all() -> tuple[dict[Target, Path], list[str]]:
    """The libraries of all targets and, for each, what compiled it."""
    libraries, compilers = {}, []
    for number, target in enumerate(TARGETS, start=1):
        say(f"[{number}/{len(TARGETS)}] {target.triple}")
        start = time.monotonic()
        libraries[target], compiled_by = compile_library(target)
        compilers.append(f"{target.triple}: {compiled_by}")
        say(f"      {libraries[target].stat().st_size / 1000:.0f} kB after {time.monotonic() - start:.0f} s")
    return libraries, compilers


def compiled_elsewhere(folder: Path) -> tuple[dict[Target, Path], list[str]]:
    """The libraries found in a folder."""
    libraries = {}
    for target in TARGETS:
        candidates = [target, NATIVE_WINDOWS] if target is WINDOWS else [target]
        paths = [folder / candidate.triple / candidate.library for candidate in candidates]
        found = [path for path in paths if path.is_file()]
        if not found:
            raise SystemExit(f"error: {paths[0]} is missing")
        libraries[target] = found[0]
    return libraries, []


def pack(
    out: Path, fmi: int, folders: Mapping[str, tuple[Target, ...]], libraries: dict[Target, Path], *options: str
) -> None:
    """Packs an FMU for this version of FMI with a library in each of these folders of `binaries/`."""
    command = ["cargo", "run", "--locked", "--release", "--quiet", "--bin", "build_fmu", "--"]
    command += ["--fmi", str(fmi), "--out", str(out), *options]
    for folder, targets in folders.items():
        parts = [libraries[target] for target in targets]
        path = parts[0] if len(parts) == 1 else universal(out / f"{folder}.dylib", parts)
        command += ["--binary", f"{folder}={path}"]
    # What it says of the unfinished file is no news.
    if subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL).returncode:
        raise SystemExit("error: the FMU could not be packed; the message is above")


if __name__ == "__main__":
    main()
