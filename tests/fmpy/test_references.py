"""The packed FMUs against the reference experiments inside them, under several importers, with a margin; and the
tolerances tell a testbed apart whose stiffness is off by 1 %."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from conftest import ROOT

from prw.checking.agreement import compare
from prw.checking.experiments import FOLDER, read_experiments
from tools.validation.importers import IMPORTERS

#: Of the tolerance: what the FMU takes at most, and what 1 % of k1 takes at least.
PASSES, FAILS = 0.5, 1.4
NAMES = ["fig4_opposite", "fig4_equal", "rate_step", "from_40_degrees", "other_parameters", "closed_loop"]


@pytest.fixture(scope="module", params=["", "fmi3/"], ids=["fmi2", "fmi3"])
def either_fmu(request, fmu) -> Path:
    return fmu.parent / f"{request.param}{fmu.name}"


@pytest.fixture(scope="module")
def known(either_fmu):
    return {experiment.name: experiment for experiment in read_experiments(either_fmu)}


def test_the_fmu_brings_them_along(either_fmu, known):
    assert list(known) == NAMES
    with zipfile.ZipFile(either_fmu) as archive:
        inside = {name.removeprefix(f"{FOLDER}/") for name in archive.namelist() if name.startswith(FOLDER)}
        zipped = sum(i.compress_size for i in archive.infolist() if i.filename.startswith(FOLDER))
    assert inside == {path.name for path in (ROOT / "modelDescription" / FOLDER).iterdir()}
    assert zipped < 100_000


@pytest.mark.parametrize("importer", IMPORTERS, ids=lambda importer: importer.name)
@pytest.mark.parametrize("name", NAMES)
def test_the_tolerances_are_honest(either_fmu, known, importer, name):
    experiment = known[name]

    def share(parameters) -> float:
        agreement = compare(importer.run(either_fmu, experiment, parameters), experiment, importer.interface)
        assert len(agreement.time) == len(experiment.reference["time"])
        return max(difference.largest / difference.allowed for difference in agreement.variables.values())

    right = dict(experiment.parameters)
    assert share(right) < PASSES
    assert share({**right, "k1": 1.01 * right["k1"]}) > FAILS
