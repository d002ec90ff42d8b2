"""Fixtures: an FMU without directional derivatives, and a pendulum in C for each FMI version."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import pytest
from built import built

HERE = Path(__file__).resolve().parent


@pytest.fixture(scope="session")
def lag(version: str) -> Path:
    """An FMU without directional derivatives."""
    return Path(built(f"{version}lag.fmu"))


@pytest.fixture(scope="session", params=["2", "3"], ids=["fmi2", "fmi3"])
def pendulum(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """pendulum.c, compiled here: FMI 2.0 for Model Exchange, FMI 3.0 for Co-Simulation."""
    if sys.platform != "linux" or shutil.which("cc") is None:
        pytest.skip("needs a C compiler on Linux")
    directory = tmp_path_factory.mktemp("pendulum")
    library, fmu = directory / "pendulum.so", directory / "pendulum.fmu"
    headers = Path(fmpy.__file__).parent / "c-code"
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-I", str(headers)]
    version = ["-DFMI3"] if request.param == "3" else []
    subprocess.run(["cc", *flags, *version, str(HERE / "pendulum.c"), "-o", str(library), "-lm"], check=True)
    processor = subprocess.run(["uname", "-m"], check=True, capture_output=True, text=True).stdout.strip()
    platform = f"{processor}-linux" if request.param == "3" else "linux64"
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(HERE / f"pendulum{request.param}.xml", "modelDescription.xml")
        archive.write(library, f"binaries/{platform}/pendulum.so")
    return fmu
