"""The same C programs run with the libraries for Linux, Windows and ARM, and calculate the same."""

from __future__ import annotations

import pytest
from conftest import HERE, RUNNERS, disagreement, library, parse

REFERENCE = RUNNERS[0]


@pytest.fixture
def run(run_c, unpacked, description):
    """Runs a program with the library for its platform."""

    def run(program, runner):
        path = str(library(unpacked, runner.folder))
        if program == "scenario":
            return run_c(runner, HERE / "scenario.c", path)
        # Layout of the types, Model Exchange, a hundred times loading and unloading.
        return run_c(runner, HERE / "drive.c", path, description.guid)

    return run


@pytest.mark.parametrize("program", ["scenario", "drive"])
def test_every_number_agrees(program, foreign, run, capsys):
    largest, count = disagreement(run(program, foreign), run(program, REFERENCE))
    with capsys.disabled():
        print(f"\n{program} on {foreign.folder}: {count} numbers, largest relative difference {largest:.2g} ", end="")
    assert largest <= 1e-12


def test_it_is_the_experiment_of_fig_4(run):
    """Opposite motors roll the wrist and do not pitch it; what is refused is logged with its name."""
    text = run("scenario", REFERENCE)
    outputs = [numbers for name, numbers in parse(text) if name == "outputs"]
    assert len(outputs) == 2 * 2000
    pitch, roll = ([row[column] for row in outputs] for column in (2, 3))
    assert max(map(abs, pitch)) < 1e-12 and 0.05 < max(map(abs, roll)) < 0.5
    errors = [line for line in text.splitlines() if line.startswith("log 3 ")]
    assert len(errors) >= 2 * 6 and sum("k1" in line for line in errors) >= 2 * 2
