"""The examples as modules, run from the project's folder, beside the oracle."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "examples"), str(ROOT / "tests" / "oracle")]


@pytest.fixture(autouse=True)
def in_the_project(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the examples look for the FMUs."""
    monkeypatch.chdir(ROOT)
    for name in ("prw_testbed.fmu", "prw_controller.fmu"):
        if not (ROOT / "target" / "fmu" / name).is_file():
            pytest.exit(f"target/fmu/{name} is missing; build it with `make closed-loop-fmus`", returncode=1)
