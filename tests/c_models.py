"""Test FMUs in C: compiles the models of `crates/fmu-test-kit/models`, and packs them with their descriptions."""

from __future__ import annotations

import functools
import platform
import subprocess
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path

MODELS = Path(__file__).parents[1] / "crates" / "fmu-test-kit" / "models"


@functools.cache
def library(model: str, *flags: str) -> bytes:
    """Returns the library of a model, which is compiled once for all FMUs."""
    with tempfile.TemporaryDirectory() as directory:
        to = Path(directory) / "model.so"
        common = ["-std=gnu11", f"@{MODELS / 'compiler-options.txt'}"]
        # One of the integrator's traits is that the library uses functions of libm without being linked to it.
        libraries = ["-lpthread"] if model == "integrator" else ["-lm", "-lpthread"]
        subprocess.run(["cc", *common, *flags, MODELS / f"{model}.c", "-o", to, *libraries], check=True)
        return to.read_bytes()


def pack(
    path: Path, model: str, description: str, changes: dict[str, str] | None = None, flags: tuple[str, ...] = ()
) -> Path:
    """Packs a model, compiled with `flags`, into the FMU `path`, and returns it. `description` is the name of its model description, which
    ends with the FMI version, and `changes` are replacements in it.
    """
    text = (MODELS / f"{description}.xml").read_text(encoding="utf-8")
    for old, new in (changes or {}).items():
        assert old in text, old
        text = text.replace(old, new)
    binaries = "linux64" if description.endswith("2") else f"{platform.machine()}-linux"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", text)
        archive.writestr(f"binaries/{binaries}/{model}.so", library(model, *flags))
        archive.writestr("resources/gain.txt", "2.5")
    return path


def repacked(fmu: Path, path: Path, change: Callable[[str, bytes], bytes]) -> Path:
    """Copies an FMU to `path`; the content of each file is `change(name, content)`."""
    with zipfile.ZipFile(fmu) as original, zipfile.ZipFile(path, "w") as archive:
        for name in original.namelist():
            archive.writestr(name, change(name, original.read(name)))
    return path
