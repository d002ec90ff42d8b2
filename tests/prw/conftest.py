"""Fixtures: the packed FMUs, and a pendulum in C of either version of FMI."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
FMUS = ROOT / "target" / "fmu"
sys.path.insert(0, str(ROOT / "tests" / "oracle"))


def built(name: str, target: str) -> Path:
    """The FMU that `make target` leaves under that name."""
    path = FMUS / name
    if not path.is_file():
        pytest.exit(f"{path} is missing; build it with `make {target}`", returncode=1)
    return path


@pytest.fixture(scope="session", params=["", "fmi3/"], ids=["fmi2", "fmi3"])
def testbed(request: pytest.FixtureRequest) -> Path:
    """The testbed for FMI 2.0 and for FMI 3.0."""
    return built(f"{request.param}prw_testbed.fmu", "fmu")


@pytest.fixture(scope="session", params=["", "fmi3/"], ids=["fmi2", "fmi3"])
def controller(request: pytest.FixtureRequest) -> Path:
    """The controller for FMI 2.0 and for FMI 3.0."""
    return built(f"{request.param}prw_controller.fmu", "closed-loop-fmus")


@pytest.fixture(scope="session", params=["", "fmi3/"], ids=["fmi2", "fmi3"])
def lag(request: pytest.FixtureRequest) -> Path:
    """An FMU without directional derivatives."""
    return built(f"{request.param}lag.fmu", "closed-loop-fmus")


@pytest.fixture(scope="session", params=["2", "3"], ids=["fmi2", "fmi3"])
def pendulum(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """pendulum.c, compiled here: FMI 2.0 for Model Exchange, FMI 3.0 for Co-Simulation."""
    if sys.platform != "linux" or shutil.which("cc") is None:
        pytest.skip("needs a C compiler on Linux")
    folder = tmp_path_factory.mktemp("pendulum")
    library, fmu = folder / "pendulum.so", folder / "pendulum.fmu"
    headers = Path(fmpy.__file__).parent / "c-code"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-I", str(headers)]
    version = ["-DFMI3"] if request.param == "3" else []
    subprocess.run(["cc", *flags, *version, str(HERE / "pendulum.c"), "-o", str(library), "-lm"], check=True)
    processor = subprocess.run(["uname", "-m"], check=True, capture_output=True, text=True).stdout.strip()
    place = f"{processor}-linux" if request.param == "3" else "linux64"
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(HERE / f"pendulum{request.param}.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{place}/pendulum.so")
    return fmu
