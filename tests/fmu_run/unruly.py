"""The FMU in C that unruly.c and unruly.xml make."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import fmpy

HERE = Path(__file__).parent


def build(folder: Path, *flags: str) -> Path:
    """Compiles it with `flags` and packs it in `folder`; returns the FMU."""
    library, fmu = folder / "unruly.so", folder / "unruly.fmu"
    headers = Path(fmpy.__file__).parent / "c-code"
    common = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC", "-I", headers]
    subprocess.run(["cc", *common, *flags, HERE / "unruly.c", "-o", library], check=True)
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(HERE / "unruly.xml", "modelDescription.xml")
        archive.write(library, "binaries/linux64/unruly.so")
    return fmu
