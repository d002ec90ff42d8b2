"""Fixtures: FMUs in C that misbehave."""

from __future__ import annotations

from pathlib import Path

import pytest
from c_models import pack


@pytest.fixture(scope="session")
def faulty_fmu(tmp_path_factory) -> Path:
    """An FMU in C whose parameter `behaviour` selects how its runs end. It lacks the functions of optional capabilities."""
    return pack(
        tmp_path_factory.mktemp("faulty") / "faulty_fmu.fmu", "integrator", "misbehaving2", flags=("-DMINIMAL",)
    )


@pytest.fixture(scope="session")
def faulty_fmu3(tmp_path_factory) -> Path:
    """An FMU in C for FMI 3.0 whose parameter `behaviour` selects how its runs end."""
    return pack(tmp_path_factory.mktemp("faulty") / "faulty_fmu3.fmu", "integrator", "misbehaving3")
