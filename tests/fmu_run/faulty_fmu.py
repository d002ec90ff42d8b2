"""Makes misbehaving FMUs in C, and changed copies of FMUs."""

from __future__ import annotations

import subprocess
import zipfile
from collections.abc import Callable
from pathlib import Path

import fmpy

HERE = Path(__file__).parent


def build(directory: Path, *flags: str, name: str = "faulty_fmu", platform: str = "linux64") -> Path:
    """Compiles the C file `name` of this directory with `flags`, and packs it with its description. Returns the FMU in `directory`.

    platform: the directory in `binaries/`."""
    library, fmu = directory / f"{name}.so", directory / f"{name}.fmu"
    headers = Path(fmpy.__file__).parent / "c-code"
    common = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC", "-I", headers]
    subprocess.run(["cc", *common, *flags, HERE / f"{name}.c", "-o", library], check=True)
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(HERE / f"{name}.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{platform}/{name}.so")
    return fmu


def repacked(fmu: Path, path: Path, change: Callable[[str, bytes], bytes]) -> Path:
    """Copies an FMU to `path`; the content of each file is `change(name, content)`."""
    with zipfile.ZipFile(fmu) as original, zipfile.ZipFile(path, "w") as archive:
        for name in original.namelist():
            archive.writestr(name, change(name, original.read(name)))
    return path
