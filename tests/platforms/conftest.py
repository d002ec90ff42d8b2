"""The files in dist/, and the libraries in them."""

from __future__ import annotations

import os
import subprocess
import zipfile
from pathlib import Path

import pytest
import toolchain
from built import ROOT
from targets import MODEL, Target

DIST = Path(os.environ.get("DIST", ROOT / "dist"))
HERE = Path(__file__).parent
#: The FMU for FMI 3.0.
FMI3 = f"{MODEL}-fmi3.fmu"
FMUS = (DIST / f"{MODEL}.fmu", DIST / FMI3)


def pytest_configure() -> None:
    """Exits early if dist/ does not contain a release."""
    if not FMUS[0].is_file():
        pytest.exit(f"{FMUS[0]} is missing; make it with `make release`", returncode=1)


def names(archive: Path) -> set[str]:
    """Checks that an archive is intact, and returns the names of its files."""
    with zipfile.ZipFile(archive) as content:
        assert content.testzip() is None
        return set(content.namelist())


def binaries(fmu: Path) -> dict[str, bytes]:
    """Returns the libraries of an FMU, by the names of their directories in `binaries/`."""
    with zipfile.ZipFile(fmu) as archive:
        return {name.split("/")[1]: archive.read(name) for name in archive.namelist() if name.startswith("binaries/")}


def wheel(target: Target) -> Path:
    """Returns the wheel of fmu-run for a target."""
    (path,) = DIST.glob(f"fmu_run-*{target.wheel}*.whl")
    return path


def prw_wheel() -> Path:
    """Returns the wheel of prw."""
    (path,) = DIST.glob("prw-*-py3-none-any.whl")
    return path


@pytest.fixture(scope="session")
def wine(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment variables of programs for Windows, which run in an empty Windows without a display."""
    toolchain.need(toolchain.WINE)
    environment = toolchain.windows(tmp_path_factory.mktemp("wine"))
    subprocess.run([toolchain.WINE, "wineboot", "--init"], env=environment, capture_output=True, timeout=300)
    return environment
