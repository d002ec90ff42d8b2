"""In several importers, the packed testbeds agree with their reference experiments. If the stiffness k1 is wrong by 1 %, they do not."""

from __future__ import annotations

import csv
import zipfile

import cross_check
import fmpy
import pytest
from built import ROOT

from prw.checking.agreement import compare
from prw.checking.experiments import DIRECTORY, read_experiments
from tools.validation.importers import IMPORTERS

#: Largest error of the FMU, and smallest effect of a change of k1 by 1 %, as fractions of the tolerance.
PASSES, FAILS = 0.5, 1.4
NAMES = ["fig4_opposite", "fig4_equal", "rate_step", "from_40_degrees", "other_parameters", "closed_loop"]


@pytest.fixture(scope="module")
def known(testbed):
    return {experiment.name: experiment for experiment in read_experiments(testbed)}


def test_the_fmu_contains_the_experiments(testbed, known):
    assert list(known) == NAMES
    with zipfile.ZipFile(testbed) as archive:
        inside = {name.removeprefix(f"{DIRECTORY}/") for name in archive.namelist() if name.startswith(DIRECTORY)}
        zipped = sum(i.compress_size for i in archive.infolist() if i.filename.startswith(DIRECTORY))
    assert inside == {path.name for path in (ROOT / "modelDescription" / DIRECTORY).iterdir()}
    assert zipped < 100_000


@pytest.mark.parametrize("importer", IMPORTERS, ids=lambda importer: importer.name)
@pytest.mark.parametrize("name", NAMES)
def test_the_tolerances_detect_a_wrong_stiffness(testbed, known, importer, name):
    experiment = known[name]

    def share(parameters) -> float:
        agreement = compare(importer.run(testbed, experiment, parameters), experiment, importer.interface)
        assert len(agreement.time) == len(experiment.reference["time"])
        return max(difference.largest / difference.allowed for difference in agreement.variables.values())

    right = dict(experiment.parameters)
    assert share(right) < PASSES
    assert share({**right, "k1": 1.01 * right["k1"]}) > FAILS


def test_the_directories_for_the_cross_check(fmu, tmp_path):
    """The directories follow the rules of the FMI Cross-Check, and packing twice gives the same bytes."""
    for name in ("one.zip", "other.zip"):
        cross_check.pack(fmu, tmp_path / name)
    assert (tmp_path / "one.zip").read_bytes() == (tmp_path / "other.zip").read_bytes()
    with zipfile.ZipFile(tmp_path / "one.zip") as archive:
        archive.extractall(tmp_path)
    description = fmpy.read_model_description(str(fmu))
    for name in NAMES:
        directory = tmp_path / name
        ends = ".fmu", "_in.csv", "_ref.csv", "_ref.opt", ".ssv"
        assert {path.name for path in directory.iterdir()} == {*(f"{name}{end}" for end in ends), "README.md"}
        assert (directory / f"{name}.fmu").read_bytes() == fmu.read_bytes()
        options = dict(line.split(", ") for line in (directory / f"{name}_ref.opt").read_text().splitlines())
        for kind, causality in (("in", "input"), ("ref", "output")):
            with open(directory / f"{name}_{kind}.csv", newline="") as file:
                header, *rows = csv.reader(file)
            variables = {v.name for v in description.modelVariables if v.causality == causality}
            assert header[0] == "time" and set(header[1:]) == variables
            assert [float(rows[0][0]), float(rows[-1][0])] == [
                float(options[f"{end}Time"]) for end in ("Start", "Stop")
            ]
