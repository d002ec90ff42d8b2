"""Fixtures: the FMU's description and files, its instances, which are freed at the end of a test, and the oracle."""

from __future__ import annotations

import fmpy
import pytest
from instance import Instance
from lagrange import linear_model, table_1


@pytest.fixture(scope="session")
def description(fmu):
    """The model description as FMPy reads it, validated against the XSD."""
    return fmpy.read_model_description(str(fmu), validate=True)


@pytest.fixture(scope="session")
def unpacked(fmu, unpack):
    """The directory of the unpacked FMU."""
    return unpack(fmu)


@pytest.fixture
def make_instance(unpacked, description):
    """Returns a function that makes Co-Simulation instances. All are freed when the test ends."""
    instances = []

    def make(name: str = "testbed") -> Instance:
        instances.append(Instance(unpacked, description, name))
        return instances[-1]

    yield make
    for instance in instances:
        instance.free()


@pytest.fixture
def instance(make_instance):
    """One Co-Simulation instance."""
    return make_instance()


@pytest.fixture(scope="session")
def model():
    """The oracle with the parameters of Table 1."""
    return linear_model(table_1())
