"""Packs the FMUs of a release, and the system that two of them make."""

from __future__ import annotations

import os
import shutil
import subprocess
import sysconfig
import zipfile
from collections.abc import Mapping
from pathlib import Path

import cross_check
from libraries import prepare, target_folder
from targets import (
    ARM_FOLDERS,
    CONTROLLER,
    FMI3_FOLDERS,
    FOLDERS,
    MODEL,
    NATIVE_WINDOWS,
    PACKERS,
    ROOT,
    TARGETS,
    WEBASSEMBLY,
    WINDOWS,
    Target,
)
from toolchain import say, toolchain

SYSTEM = "prw_closed_loop"
#: The page that runs the FMU, which is also a file of its own.
PAGE = "documentation/index.html"

Folders = Mapping[str, tuple[Target, ...]]


def make(libraries: Path, out: Path, scratch: Path) -> None:
    """The files of a release that are made of libraries in folders called like their targets."""
    packages = [argument for _, package in PACKERS.values() for argument in ("--package", package)]
    _run("cargo", "build", "--locked", "--release", "--bins", *packages, what="the programs that pack FMUs")
    for model in PACKERS:
        say(f"packing {model}")
        found = {target: _library(libraries, model, target) for target in TARGETS}
        _pack(model, 2, FOLDERS, found, scratch).rename(out / f"{model}.fmu")
        _pack(model, 3, FMI3_FOLDERS, found, scratch).rename(out / f"{model}-fmi3.fmu")
        if model == MODEL:
            arm = _pack(model, 2, ARM_FOLDERS, found, scratch, "--any-processor")
            arm.rename(out / f"{model}-linux-arm64.fmu")
    say(f"packing {MODEL} as C sources, and {SYSTEM}")
    _sources(scratch).rename(out / f"{MODEL}-source.fmu")
    with zipfile.ZipFile(out / f"{MODEL}.fmu") as archive:
        (out / f"{MODEL}.html").write_bytes(archive.read(PAGE))
    arguments = [f"--testbed={out / MODEL}.fmu", f"--controller={out / CONTROLLER}.fmu", f"--out={scratch}"]
    _run(_program("build_closed_loop"), *arguments, what=SYSTEM)
    (scratch / f"{SYSTEM}.ssp").rename(out / f"{SYSTEM}.ssp")
    cross_check.pack(out / f"{MODEL}.fmu", out / f"{MODEL}-cross-check.zip")


def source_compiler() -> str:
    """What makes the C sources; stops if some of it is missing."""
    version = subprocess.run([_wasm2c(), "--version"], capture_output=True, text=True, check=True).stdout.strip()
    return f"{toolchain(WEBASSEMBLY).description}, wasm2c {version}"


def _wasm2c() -> str:
    path = shutil.which("wasm2c", path=sysconfig.get_path("scripts"))
    if not path:
        raise SystemExit("error: wasm2c is missing in this Python environment; start this with make release")
    return path


def _library(folder: Path, model: str, target: Target) -> Path:
    candidates = [target, NATIVE_WINDOWS] if target is WINDOWS else [target]
    paths = [folder / candidate.triple / candidate.library(model) for candidate in candidates]
    for path in paths:
        if path.is_file():
            return path
    raise SystemExit(f"error: {paths[0]} is missing")


def _pack(model: str, fmi: int, folders: Folders, libraries: dict[Target, Path], scratch: Path, *options: str) -> Path:
    """An FMU for this version of FMI with a library in each of these folders of `binaries/`."""
    for folder, targets in folders.items():
        # It joins those for macOS itself.
        options += (f"--binary={folder}={libraries[targets[0]]}",)
    _, environment, _ = prepare(WEBASSEMBLY)
    command = (_program(PACKERS[model][0]), f"--fmi={fmi}", f"--out={scratch}", *options)
    _run(*command, what=f"the FMU {model}", environment=environment)
    return scratch / ("fmi3" if fmi == 3 else "") / f"{model}.fmu"


def _sources(scratch: Path) -> Path:
    """The FMU of C sources."""
    _, environment, _ = prepare(WEBASSEMBLY)
    environment["WASM2C"] = _wasm2c()
    command = (_program(PACKERS[MODEL][0]), "--c-sources", f"--out={scratch}")
    _run(*command, what=f"the C sources of {MODEL}", environment=environment)
    return scratch / "source" / f"{MODEL}.fmu"


def _program(name: str) -> str:
    return str(target_folder() / "release" / name)


def _run(*command: str, what: str, environment: Mapping[str, str] = os.environ) -> None:
    # What they say of unfinished files is no news.
    if subprocess.run(command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL).returncode:
        raise SystemExit(f"error: {what} could not be made; the messages are above")
