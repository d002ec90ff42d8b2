"""Runs the tests in the project's directory, and checks that the FMUs of the examples are built."""

from __future__ import annotations

import pytest
from built import ROOT, built


@pytest.fixture(autouse=True)
def in_the_project(monkeypatch: pytest.MonkeyPatch) -> None:
    """Changes to the directory from which the examples find the FMUs, and exits if an FMU is missing."""
    monkeypatch.chdir(ROOT)
    for name in ("prw_testbed.fmu", "prw_controller.fmu"):
        built(name)
