"""Fixtures: the packed FMUs, and one in C that does what FMUs should not."""

from __future__ import annotations

import platform
from pathlib import Path

import pytest
from unruly import build

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
    return build(tmp_path_factory.mktemp("unruly"))


@pytest.fixture(scope="session")
def unruly3(tmp_path_factory) -> Path:
    """The same for FMI 3.0, in what FMI 3.0 has of its own (unruly3.c)."""
    return build(tmp_path_factory.mktemp("unruly3"), name="unruly3", platform=f"{platform.machine()}-linux")
