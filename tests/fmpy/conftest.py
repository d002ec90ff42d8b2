"""Fixtures: the packed FMU, its description, and instances of it that are freed at the end of a test."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import fmpy
import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "oracle"))

from lagrange import linear_model, table_1  # noqa: E402
from slave import Slave  # noqa: E402


@pytest.fixture(scope="session")
def fmu() -> Path:
    """The packed FMU."""
    path = ROOT / "target" / "fmu" / "prw_testbed.fmu"
    if not path.is_file():
        pytest.exit(f"{path} is missing; build it with `make fmu`", returncode=1)
    return path


@pytest.fixture(scope="session")
def description(fmu):
    """FMPy's model description, checked against the XSD as it is read."""
    return fmpy.read_model_description(str(fmu), validate=True)


@pytest.fixture(scope="session")
def unpacked(fmu):
    """The folder of the unpacked FMU."""
    folder = fmpy.extract(str(fmu))
    yield folder
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture
def make_slave(unpacked, description):
    """Makes Co-Simulation instances; frees them all when the test ends."""
    slaves = []

    def make(name: str = "testbed") -> Slave:
        slaves.append(Slave(unpacked, description, name))
        return slaves[-1]

    yield make
    for slave in slaves:
        slave.free()


@pytest.fixture
def slave(make_slave):
    """One Co-Simulation instance."""
    return make_slave()


@pytest.fixture(scope="session")
def model():
    """The oracle with the parameters of Table 1."""
    return linear_model(table_1())
