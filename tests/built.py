"""Where the project is, what `make` has built, and what is installed."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FMUS = ROOT / "target" / "fmu"


def built(name: str, target: str = "closed-loop-fmus") -> Path:
    """The file of that name that `make TARGET` leaves."""
    path = FMUS / name
    if not path.exists():
        pytest.exit(f"{path} is missing; build it with `make {target}`", returncode=1)
    return path


def needed(module: str, package: str) -> None:
    """Skip the tests of a file where the package is not installed."""
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{package} is not installed; `make test-importers` installs it", allow_module_level=True)
