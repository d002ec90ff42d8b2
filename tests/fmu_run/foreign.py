"""Packs FMUs in C that behave like FMUs of other producers, in the manners that crates/fmu-run/tests/foreign/foreign.c lists."""

from __future__ import annotations

import functools
import subprocess
import tempfile
import zipfile
from pathlib import Path

import fmpy

SOURCE = Path(__file__).parents[2] / "crates" / "fmu-run" / "tests" / "foreign"


@functools.cache
def library() -> bytes:
    """Returns the library, which is compiled once for all FMUs."""
    headers = Path(fmpy.__file__).parent / "c-code"
    with tempfile.TemporaryDirectory() as directory:
        to = Path(directory) / "foreign.so"
        flags = ["-std=gnu99", "-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC", "-I", headers]
        subprocess.run(["cc", *flags, SOURCE / "foreign.c", "-o", to], check=True)
        return to.read_bytes()


def foreign(directory: Path, manner: str, version: str = "2.0", changes: dict[str, str] | None = None) -> Path:
    """Packs the FMU with this manner and for this FMI version into the directory, and returns it. `changes` are replacements in its
    model description.
    """
    fmu = directory / f"{manner}{version[0]}.fmu"
    platform = "linux64" if version == "2.0" else "x86_64-linux"
    with zipfile.ZipFile(fmu, "w") as archive:
        description = (SOURCE / f"foreign{version[0]}.xml").read_text(encoding="utf-8")
        for old, new in {"MANNER": manner, **(changes or {})}.items():
            assert old in description, old
            description = description.replace(old, new)
        archive.writestr("modelDescription.xml", description)
        archive.writestr(f"binaries/{platform}/foreign.so", library())
        archive.writestr("resources/gain.txt", "2.5")
    return fmu
