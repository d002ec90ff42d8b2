"""Fixtures: a linear model of the FMU, and experiments on a simulated rig."""

from __future__ import annotations

import pytest
import rig


@pytest.fixture(scope="session")
def model(fmu):
    """The FMU's linear model, for all tests that calculate in this process."""
    from prw.identification.model import Model

    with Model(fmu) as instance:
        yield instance


@pytest.fixture(scope="session")
def experiment():
    """A rig whose parameters differ from Table 1 by up to 30 %, and its response in one experiment of 6 s at 1 kHz."""
    return rig.experiment(seed=1, duration=6)
