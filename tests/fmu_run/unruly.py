"""The FMUs in C that unruly.c with unruly.xml, and unruly3.c with unruly3.xml make."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import fmpy

HERE = Path(__file__).parent


def build(folder: Path, *flags: str, name: str = "unruly", platform: str = "linux64") -> Path:
    """Compiles `name` with `flags` and packs it in `folder` for `platform`; returns the FMU."""
    library, fmu = folder / f"{name}.so", folder / f"{name}.fmu"
    headers = Path(fmpy.__file__).parent / "c-code"
    common = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC", "-I", headers]
    subprocess.run(["cc", *common, *flags, HERE / f"{name}.c", "-o", library], check=True)
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(HERE / f"{name}.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{platform}/{name}.so")
    return fmu
