"""Fixtures: the packed FMUs, and one in C that does what FMUs should not."""

from __future__ import annotations

import subprocess
import zipfile
from pathlib import Path

import fmpy
import pytest

ROOT = Path(__file__).resolve().parents[2]
FMUS = ROOT / "target" / "fmu"


def built(name: str, target: str) -> Path:
    path = FMUS / name
    if not path.is_file():
        pytest.exit(f"{path} is missing; build it with `make {target}`", returncode=1)
    return path


@pytest.fixture(scope="session", params=["", "fmi3/"], ids=["fmi2", "fmi3"])
def testbed(request) -> Path:
    """The testbed for FMI 2.0 and for FMI 3.0."""
    return built(f"{request.param}prw_testbed.fmu", "fmu")


@pytest.fixture(scope="session")
def testbed2() -> Path:
    """The testbed for FMI 2.0."""
    return built("prw_testbed.fmu", "fmu")


@pytest.fixture(scope="session", params=["", "fmi3/"], ids=["fmi2", "fmi3"])
def controller(request) -> Path:
    """The controller for FMI 2.0 and for FMI 3.0."""
    return built(f"{request.param}prw_controller.fmu", "closed-loop-fmus")


@pytest.fixture(scope="session")
def unruly(tmp_path_factory) -> Path:
    """An FMU in C, compiled here, whose parameter `mood` says how it misbehaves (unruly.c)."""
    folder = tmp_path_factory.mktemp("unruly")
    library = folder / "unruly.so"
    headers = Path(fmpy.__file__).parent / "c-code"
    source = Path(__file__).with_name("unruly.c")
    subprocess.run(
        ["cc", "-std=c99", "-Wall", "-Wextra", "-O2", "-shared", "-fPIC", "-I", headers, source, "-o", library],
        check=True,
    )
    fmu = folder / "unruly.fmu"
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(Path(__file__).with_name("unruly.xml"), "modelDescription.xml")
        archive.write(library, "binaries/linux64/unruly.so")
    return fmu
