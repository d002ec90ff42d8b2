"""Imports the examples as modules and runs them in the repository root."""

from __future__ import annotations

import pytest
from built import ROOT, built


@pytest.fixture(autouse=True)
def in_the_project(monkeypatch: pytest.MonkeyPatch) -> None:
    """Changes to the directory in which the examples find the FMUs."""
    monkeypatch.chdir(ROOT)
    for name in ("prw_testbed.fmu", "prw_controller.fmu"):
        built(name)
