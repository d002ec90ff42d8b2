"""The examples as modules, run from the project's folder, beside the oracle."""

from __future__ import annotations

import pytest
from built import ROOT, built


@pytest.fixture(autouse=True)
def in_the_project(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the examples look for the FMUs."""
    monkeypatch.chdir(ROOT)
    for name in ("prw_testbed.fmu", "prw_controller.fmu"):
        built(name)
