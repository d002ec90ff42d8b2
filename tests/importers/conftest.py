"""Fixtures: FMUs for importers, and a check of their rows in docs/compatibility.md."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import pytest
from built import ROOT, built

from tools.documentation.sources import read_table


@pytest.fixture(scope="session")
def tunable(version: str) -> Path:
    """The testbed with tunable parameters."""
    return built(f"tunable/{version}prw_testbed.fmu", "importer-fmus")


@pytest.fixture(scope="session")
def closed_loop() -> Path:
    """The SSP of controller and testbed."""
    return built("prw_closed_loop.ssp")


@pytest.fixture(scope="session")
def stated():
    """Returns a function that checks that docs/compatibility.md states the version of a tool and this result."""
    rows = read_table(ROOT / "docs/compatibility.md", "At a glance").rows

    def stated(tool: str, package: str, result: str) -> None:
        (row,) = (row for row in rows if tool in row[0])
        assert metadata.version(package) in row[0] and result in row[-1], row

    return stated
