"""Packs the FMUs of a release, and the closed loop of testbed and controller."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

import cross_check
from libraries import environment, log, run, target_directory
from targets import ARM_DIRECTORIES, CONTROLLER, DIRECTORIES, FMI3_DIRECTORIES, MODEL, PACKERS, Target

SYSTEM = "prw_closed_loop"
#: The page that runs the FMU; a release also contains it as a file.
PAGE = "documentation/index.html"

Directories = Mapping[str, tuple[Target, ...]]


def make(libraries: Mapping[str, Mapping[Target, Path]], out: Path, scratch: Path) -> None:
    """Builds the files of a release that contain the libraries of the models."""
    packages = [argument for _, package in PACKERS.values() for argument in ("--package", package)]
    run("cargo", "build", "--locked", "--bins", *packages)
    for model, found in libraries.items():
        log(f"packing {model}")
        _pack(model, 2, DIRECTORIES, found, scratch).rename(out / f"{model}.fmu")
        _pack(model, 3, FMI3_DIRECTORIES, found, scratch).rename(out / f"{model}-fmi3.fmu")
    log(f"packing the variants of {MODEL}, and {SYSTEM}")
    arm = _pack(MODEL, 2, ARM_DIRECTORIES, libraries[MODEL], scratch, "--any-processor")
    arm.rename(out / f"{MODEL}-linux-arm64.fmu")
    _run(PACKERS[MODEL][0], "--c-sources", f"--out={scratch}")
    (scratch / "source" / f"{MODEL}.fmu").rename(out / f"{MODEL}-source.fmu")
    with zipfile.ZipFile(out / f"{MODEL}.fmu") as archive:
        (out / f"{MODEL}.html").write_bytes(archive.read(PAGE))
        # The page links to it.
        (out / "manual.html").write_bytes(archive.read("documentation/manual.html"))
    _run(
        "build_closed_loop", f"--testbed={out / MODEL}.fmu", f"--controller={out / CONTROLLER}.fmu", f"--out={scratch}"
    )
    (scratch / f"{SYSTEM}.ssp").rename(out / f"{SYSTEM}.ssp")
    cross_check.pack(out / f"{MODEL}.fmu", out / f"{MODEL}-cross-check.zip")


def _pack(
    model: str, fmi: int, directories: Directories, libraries: Mapping[Target, Path], scratch: Path, *options: str
) -> Path:
    """Returns an FMU for this FMI version with a library in each of these directories of `binaries/`."""
    # The program joins the macOS libraries into a universal library.
    binaries = [f"--binary={name}={libraries[targets[0]]}" for name, targets in directories.items()]
    _run(PACKERS[model][0], f"--fmi={fmi}", f"--out={scratch}", *binaries, *options)
    return scratch / ("fmi3" if fmi == 3 else "") / f"{model}.fmu"


def _run(program: str, *arguments: str) -> None:
    # These programs also compile the model to WebAssembly, for the page and for the C sources, so they need this
    # environment.
    run(str(target_directory() / "debug" / program), *arguments, environment=environment())
