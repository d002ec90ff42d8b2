"""The same C programs run with the libraries for Linux, Windows and ARM, and calculate the same."""

from __future__ import annotations

import re

import pytest
from conftest import HERE, ROOT, RUNNERS, disagreement, library, parse

REFERENCE = RUNNERS[0]


@pytest.fixture
def run(run_c, unpacked, unpacked_fmi3, description):
    """Runs a program with the library for its platform."""

    def run(program, runner):
        if program == "scenario for FMI 3.0":
            path = str(library(unpacked_fmi3, runner.fmi3_folder))
            return run_c(runner, HERE / "scenario.c", path, options=("-DFMI3",))
        path = str(library(unpacked, runner.folder))
        if program == "scenario":
            return run_c(runner, HERE / "scenario.c", path)
        # Layout of the types, Model Exchange, a hundred times loading and unloading.
        drive = ROOT / "crates/fmu-export/tests/c/drive.c"
        return run_c(runner, drive, path, description.guid, options=("-DTESTBED",))

    return run


@pytest.mark.parametrize("program", ["scenario", "scenario for FMI 3.0", "drive"])
def test_every_number_agrees(program, foreign, run, capsys):
    largest, count = disagreement(run(program, foreign), run(program, REFERENCE))
    with capsys.disabled():
        print(f"\n{program} on {foreign.folder}: {count} numbers, largest relative difference {largest:.2g} ", end="")
    assert largest <= 1e-12


@pytest.mark.parametrize("runner", RUNNERS, ids=lambda runner: runner.folder)
def test_fmi_3_gives_the_same_bits(runner, run):
    """All digits of every number, and as many refusals; only version and messages differ."""
    two, three = run("scenario", runner).splitlines(), run("scenario for FMI 3.0", runner).splitlines()
    assert two[0] == "version 2.0, platform default" and three[0] == "version 3.0 of FMI"
    assert sum(line.startswith("outputs ") for line in three) == 2 * 2000
    assert sum(line.startswith("integrated ") for line in three) == 2 * 200
    said = re.compile(r"^version .*|(?<=^log 3 logStatusError: ).*")
    assert [said.sub("", line) for line in three] == [said.sub("", line) for line in two]


def test_it_is_the_experiment_of_fig_4(run):
    """Opposite motors roll the wrist and do not pitch it; what is refused is logged with its name."""
    text = run("scenario", REFERENCE)
    outputs = [numbers for name, numbers in parse(text) if name == "outputs"]
    assert len(outputs) == 2 * 2000
    pitch, roll = ([row[column] for row in outputs] for column in (2, 3))
    assert max(map(abs, pitch)) < 1e-12 and 0.05 < max(map(abs, roll)) < 0.5
    errors = [line for line in text.splitlines() if line.startswith("log 3 ")]
    assert len(errors) >= 2 * 6 and sum("k1" in line for line in errors) >= 2 * 2
