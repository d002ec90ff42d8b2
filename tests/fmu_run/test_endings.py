"""Runs that end early: the rows that are kept, and the messages."""

from __future__ import annotations

import time as clock

import fmu_run
import numpy as np
import pytest
from c_models import repacked

TIME = np.arange(11) / 10

# Expected number of rows (of 11), error and note. The position in the first table is the value of `behaviour`.
BEHAVIOURS = {
    "good": (11, None, None),
    "silent error": (6, "at 0.5 s: fmi2DoStep returned Error without a message", None),
    "pending": (
        6,
        "at 0.5 s: fmi2GetStatus, after fmi2DoStep had returned Pending, returned Error without a message",
        None,
    ),
    "fatal": (6, "at 0.5 s: fmi2DoStep returned Fatal without a message", None),
    "discard": (6, "at 0.5 s: fmi2DoStep: no more of this after half", None),
    "no status": (6, "at 0.5 s: fmi2DoStep returned Error without a message", None),
    "no reset": (11, None, None),
    "warning": (11, None, None),
    "ends between": (6, "ended by the FMU at t = 0.525 s: the tank is empty", None),
    "ends at point": (7, "ended by the FMU at t = 0.6 s", None),
    "no terminate": (11, None, "finished; then fmi2Terminate returned Error without a message"),
    "no start": (0, "fmi2ExitInitializationMode returned Error without a message", None),
    "error if logging": (6, "at 0.5 s: fmi2DoStep: the pump ran dry", None),
    "fatal if logging": (6, "at 0.5 s: fmi2DoStep: the pump ran dry", None),
}
BEHAVIOURS_FMI3 = {
    "good": (11, None, None),
    "ends between": (6, "ended by the FMU at t = 0.525 s: the tank is empty", None),
    "ends at point": (7, "ended by the FMU at t = 0.6 s", None),
    "returns early": (6, "at 0.5 s: fmi3DoStep: the step ended early, at 0.525 s", None),
    "no terminate": (11, None, "finished; then fmi3Terminate returned Fatal without a message"),
    "error if logging": (6, "at 0.5 s: fmi3DoStep: the pump ran dry", None),
}
# After the behaviours of FMI 2.0 comes one that is slow with logging, and then those of FMI 3.0.
NUMBERS = {name: number for number, name in enumerate(BEHAVIOURS)} | {"returns early": len(BEHAVIOURS) + 1}


@pytest.mark.parametrize(
    "behaviours, fixture", [(BEHAVIOURS, "faulty_fmu"), (BEHAVIOURS_FMI3, "faulty_fmu3")], ids=["fmi2", "fmi3"]
)
@pytest.mark.parametrize("read_before_set", [False, True])
def test_behaviours(request, behaviours, fixture, read_before_set):
    number = np.repeat([NUMBERS[name] for name in behaviours], 3)
    with fmu_run.Fmu(request.getfixturevalue(fixture)) as fmu:
        arguments = {"start": {"behaviour": number}, "outputs": ["y"], "threads": 4, "read_before_set": read_before_set}
        runs = fmu.run(TIME, every=1, measures=["end", "mean"], **arguments)
        thinned = fmu.run(TIME, every=2, **arguments)
    rows, errors, notes = (dict(enumerate(np.repeat(column, 3))) for column in zip(*behaviours.values()))
    assert runs.errors == thinned.errors == {run: why for run, why in errors.items() if why}
    assert runs.notes == thinned.notes == {run: why for run, why in notes.items() if why}
    for run, count in rows.items():
        signal = np.where(np.arange(11) < count, 4.0 + TIME, np.nan)
        np.testing.assert_allclose(runs["y"][run], signal, atol=1e-15)
        np.testing.assert_allclose(thinned["y"][run], signal[::2], atol=1e-15)
        # If the FMU ends the simulation, statistics include the results until then. The statistics of a failed run are NaN.
        has_measures = runs.ok[run] or runs.errors[run].startswith("ended")
        measures = [signal[count - 1], signal[:count].mean()] if has_measures else [np.nan, np.nan]
        np.testing.assert_allclose([runs["y", "end"][run], runs["y", "mean"][run]], measures, atol=1e-14)


def test_an_end_at_the_last_time(faulty_fmu):
    with fmu_run.Fmu(faulty_fmu) as fmu:
        runs = fmu.run(TIME[:7], start={"behaviour": list(BEHAVIOURS).index("ends at point")}, outputs=["y"])
    assert runs.ok.all() and runs.notes == {0: "ended by the FMU at t = 0.6 s"}
    np.testing.assert_allclose(runs["y"][0], 4.0 + TIME[:7], atol=1e-15)


def test_silent_runs_are_repeated_once_with_logging(faulty_fmu):
    behaviours = [
        list(BEHAVIOURS).index(name)
        for name in ("error if logging", "good", "silent error", "discard", "error if logging")
    ]
    with fmu_run.Fmu(faulty_fmu) as fmu:
        runs = fmu.run(TIME, start={"behaviour": behaviours}, outputs=["y", "logged", "instances"])
        after = fmu.run(TIME, outputs=["logged", "instances"])
    assert runs.errors.keys() == {0, 2, 3, 4} and np.nanmax(runs["logged"]) == 0
    # Three runs failed without a message. They were repeated with logging, one at a time, six steps each.
    assert after["logged"].max() == 3 * 6 and after["instances"].max() == 1


def test_an_fmu_that_is_slow_with_logging(faulty_fmu):
    with fmu_run.Fmu(faulty_fmu) as fmu:
        begin = clock.monotonic()
        runs = fmu.run(np.linspace(0, 0.6, 101), start={"behaviour": len(BEHAVIOURS)}, outputs=["y"])
    # If all 76 steps were repeated, at 0.3 s each, this would take 23 s.
    assert clock.monotonic() - begin < 10
    assert runs.errors[0].endswith("fmi2DoStep returned Error without a message")


@pytest.mark.parametrize(
    "guid, why",
    [
        ("unknown", "the guid is of another FMU"),
        ("mute", "the instantiation of FaultyFmu returned NULL without a message"),
    ],
)
def test_an_fmu_that_cannot_be_instantiated(tmp_path, faulty_fmu, guid, why):
    def change(name, content):
        return content.replace(b'guid="{misbehaving}"', f'guid="{{{guid}}}"'.encode())

    with fmu_run.Fmu(repacked(faulty_fmu, tmp_path / "strange.fmu", change)) as fmu:
        runs = fmu.run(TIME, start={"slope": [1.0, 2.0]}, outputs=["y"], every=1, measures=["peak"])
    assert runs.errors == dict.fromkeys((0, 1), why)
    assert np.isnan(runs["y"]).all() and np.isnan(runs["y", "peak"]).all()
