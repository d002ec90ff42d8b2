"""Fixtures: the controller, the closed loop, and the installed masters."""

from __future__ import annotations

from pathlib import Path

import pytest
from built import built

from tools.validation import importers, masters, system


@pytest.fixture(scope="session")
def controller_fmu() -> Path:
    return built("prw_controller.fmu")


@pytest.fixture(scope="session")
def closed_loop() -> system.System:
    """The closed loop that build_closed_loop wrote."""
    return system.read(built("prw_closed_loop.ssp"), built("prw_closed_loop"))


@pytest.fixture(scope="session", params=masters.MASTERS, ids=lambda master: master.name)
def master(request) -> importers.Tool:
    """Each master in turn. A test is skipped for a master that is not installed."""
    if request.param.version() is None:
        pytest.skip(f"{request.param.package} is not installed")
    return request.param
