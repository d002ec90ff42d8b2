"""Fixtures: FMUs in C that misbehave."""

from __future__ import annotations

import platform
from pathlib import Path

import pytest
from unruly import build


@pytest.fixture(scope="session")
def unruly(tmp_path_factory) -> Path:
    """An FMU in C, compiled here, whose parameter `behaviour` selects how it misbehaves (unruly.c)."""
    return build(tmp_path_factory.mktemp("unruly"))


@pytest.fixture(scope="session")
def unruly3(tmp_path_factory) -> Path:
    """The FMU in C for FMI 3.0, for functions that FMI 2.0 does not have (unruly3.c)."""
    return build(tmp_path_factory.mktemp("unruly3"), name="unruly3", platform=f"{platform.machine()}-linux")
