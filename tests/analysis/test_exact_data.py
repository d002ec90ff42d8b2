"""Data with little noise or none: a simulation's own results, a rig with exact sensors, channels that do not change."""

from __future__ import annotations

import numpy as np
import pytest
import rig
from built import ROOT

import prw

K1 = 135.0


@pytest.fixture(scope="module")
def run(fmu) -> prw.Run:
    return prw.simulate(parameters={"k1": K1}, fmu=fmu)


def columns(run: prw.Run) -> dict[str, np.ndarray]:
    return dict(run.to_pandas().reset_index())


def exact(simulated: rig.Rig) -> dict[str, np.ndarray]:
    """Returns the columns that exact sensors record."""
    return {"time": simulated.time, **dict(zip(("theta1", "theta2"), simulated.theta.T)), **simulated.outputs}


def check(found: prw.Identification, simulated: float, worst: float) -> None:
    """Checks that the data fit, that the interval of k1 contains the simulated value, and that the relative standard error is below
    `worst`."""
    assert found.fits, (found.misfits, found.diagnosis)
    estimate = found.parameters["k1"]
    assert estimate.interval[0] < simulated < estimate.interval[1]
    assert estimate.relative < worst


def test_a_run_is_taken_as_it_is(run, fmu):
    found = prw.identify(run, fmu=fmu)
    check(found, K1, 1e-6)
    assert all(abs(found.values[name] / run.parameters[name] - 1) < 1e-6 for name in rig.NAMES)
    left_out = [note for note in found.notes if "never changes and is left out" in note]
    assert [note.split()[1] for note in left_out] == ["pitch", "pitch_rate"], (
        "motors at opposite rates do not pitch the wrist"
    )


def test_a_run_without_rates(run, fmu):
    angles = prw.Motion(run.time, run.motion.theta)
    check(prw.identify(prw.simulate(angles, {"k1": K1}, fmu=fmu), starts=1, fmu=fmu), K1, 1e-6)


def test_a_run_of_a_recording(fmu):
    """The motors rest at first. Their angles have the steps of an encoder, but are exact, because the simulation used them."""
    run = prw.simulate(ROOT / "examples" / "point_to_point.csv", {"k1": K1}, fmu=fmu)
    check(prw.identify(run, starts=1, fmu=fmu), K1, 1e-5)


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-1])
def test_any_relative_noise(run, fmu, noise):
    random, table = np.random.default_rng(1), columns(run)
    for name in run:
        table[name] = table[name] + random.normal(0, 1, len(run.time)) * noise * np.std(table[name])
    check(prw.identify(table, starts=1, fmu=fmu), K1, max(1e-6, 0.15 * noise))


def test_an_encoder_with_two_values(run, fmu):
    """Angles theta3 and theta4 that only have two values add almost no information, but must do no harm."""
    random, table = np.random.default_rng(1), columns(run)
    for name, noise in (("tau1", 0.02), ("tau2", 0.02), ("roll", 1e-3)):
        table[name] = table[name] + random.normal(0, noise, len(run.time))
    coarse = {name: 0.06 * np.round(table[name] / 0.06) for name in ("theta3", "theta4")}
    assert {len(np.unique(angle)) for angle in coarse.values()} == {2}
    table |= coarse
    found = prw.identify(table, estimate="k1", starts=1, fmu=fmu)
    without = prw.identify(
        {name: column for name, column in table.items() if name not in coarse}, estimate="k1", starts=1, fmu=fmu
    )
    check(found, K1, 1.05 * without.parameters["k1"].relative)


@pytest.mark.parametrize("rate, pattern", [(1000, "independent"), (250, "moves"), (500, "fig4"), (250, "opposite")])
def test_a_rig_with_exact_sensors(fmu, rate, pattern):
    """The motors of the rig move smoothly between the samples."""
    simulated = rig.experiment(23, 6, rate, pattern)
    check(prw.identify(exact(simulated), starts=1, fmu=fmu), simulated.parameters["k1"], 2e-4)


def test_a_fault_shows_in_exact_data(fmu):
    simulated = rig.late(rig.experiment(23, 6), 1e-4)
    found = prw.identify(exact(simulated), starts=1, fmu=fmu)
    assert not found.fits and "ms late" in found.diagnosis[0]
    assert found.diagnosis[0].startswith("tau1, tau2 comes 0.1 +-")


def test_nothing_changes(run, fmu):
    table = {**columns(run), **{name: np.zeros(len(run.time)) for name in run}}
    with pytest.raises(prw.UserError, match="nothing that was measured changes"):
        prw.identify(table, fmu=fmu)
