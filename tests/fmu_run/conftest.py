"""Fixtures: FMUs in C that misbehave."""

from __future__ import annotations

import platform
from pathlib import Path

import pytest
from faulty_fmu import build


@pytest.fixture(scope="session")
def faulty_fmu(tmp_path_factory) -> Path:
    """An FMU in C, compiled here, whose parameter `behaviour` selects how it misbehaves (faulty_fmu.c)."""
    return build(tmp_path_factory.mktemp("faulty_fmu"))


@pytest.fixture(scope="session")
def faulty_fmu3(tmp_path_factory) -> Path:
    """An FMU in C for FMI 3.0, whose parameter `behaviour` selects how its steps end (faulty_fmu3.c)."""
    return build(tmp_path_factory.mktemp("faulty_fmu3"), name="faulty_fmu3", platform=f"{platform.machine()}-linux")
