"""Runs the tests in another directory, because the examples find their FMUs from any, and checks that these are built."""

from __future__ import annotations

from pathlib import Path

import pytest
from built import built


@pytest.fixture(autouse=True)
def elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Changes to an empty directory, and exits if an FMU is missing."""
    monkeypatch.chdir(tmp_path)
    for name in ("prw_testbed.fmu", "prw_controller.fmu"):
        built(name)
