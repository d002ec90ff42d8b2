"""Fixtures: an FMU without directional derivatives, and a pendulum in C for each FMI version."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest
from built import built
from c_models import pack


@pytest.fixture(scope="session")
def lag(version: str) -> Path:
    """An FMU without directional derivatives."""
    return Path(built(f"{version}lag.fmu"))


@pytest.fixture(scope="session", params=["2", "3"], ids=["fmi2", "fmi3"])
def pendulum(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pendulum in C, compiled here: FMI 2.0 for Model Exchange, FMI 3.0 for Co-Simulation."""
    if sys.platform != "linux" or shutil.which("cc") is None:
        pytest.skip("needs a C compiler on Linux")
    path = tmp_path_factory.mktemp("pendulum") / "pendulum.fmu"
    return Path(pack(path, "equations", f"pendulum{request.param}"))
