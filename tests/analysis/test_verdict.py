"""Data that the model does not explain are detected, and their faults are named."""

from __future__ import annotations

import numpy as np
import plant
import pytest
import rig
from monte_carlo import with_fault

import prw


def recording(simulated, channels=rig.ALL, **sensors) -> dict[str, np.ndarray]:
    return rig.measure(simulated, 5, channels, **sensors)


#: Faults of monte_carlo.FAULTS with their sizes, channels that have misfits, and a part of the diagnosis.
FAULTY_RIGS = {
    ("late", 1.0): (["tau1", "tau2"], "ms late"),
    ("late", 0.1): (["tau1", "tau2"], "ms late"),
    ("lag", 2.0): (list(rig.ALL), "lags with a time constant of 2 +-"),
    ("gain", 2.0): (["tau1"], "tau1 reads 1.02"),
    ("backlash", 2.0): (["theta3"], "backlash at the motors of 0.002 +-"),
    ("friction", 0.15): (["pitch"], "friction about pitch and roll of 0.15"),
}
#: Changes of recorded columns, a channel with a misfit, and a part of the diagnosis.
FAULTY_COLUMNS = {
    "clipped": (lambda c: {n: np.clip(c[n], -3, 3) for n in ("tau1", "tau2")}, "tau1", "tau1 is cut off at 3"),
    "degrees": (lambda c: {"pitch": np.degrees(c["pitch"])}, "pitch", "pitch looks as if it were in degrees"),
    "motors in degrees": (
        lambda c: {n: np.degrees(c[n]) for n in ("theta1", "theta2")},
        "tau1",
        "theta1, theta2 look as if they were in degrees",
    ),
    "sign": (lambda c: {"theta3": -c["theta3"]}, "theta3", "theta3 has the wrong sign"),
    "swapped": (lambda c: {"tau1": c["tau2"], "tau2": c["tau1"]}, "tau2", "tau1 and tau2 are swapped"),
    "stuck": (
        lambda c: {"pitch": np.concatenate([c["pitch"][:2000], np.full(600, c["pitch"][2000]), c["pitch"][2600:]])},
        "pitch",
        "pitch is stuck from 2 to 2.599 s",
    ),
}


@pytest.mark.parametrize("fault", FAULTY_RIGS, ids=lambda fault: f"{fault[0]} {fault[1]:g}")
def test_a_rig_with_a_fault_does_not_fit(experiment, fmu, fault):
    channels, reported = FAULTY_RIGS[fault]
    found = prw.identify(recording(with_fault(experiment, *fault)), starts=1, fmu=fmu)
    assert not found.fits
    assert set(channels) <= {misfit.channel for misfit in found.verdict.misfits}, found.misfits
    assert any(reported in cause for cause in found.diagnosis), found.diagnosis


@pytest.mark.parametrize("fault", FAULTY_COLUMNS)
def test_a_faulty_column_is_named(experiment, fmu, fault):
    change, channel, reported = FAULTY_COLUMNS[fault]
    columns = recording(experiment)
    found = prw.identify({**columns, **change(columns)}, starts=1, fmu=fmu)
    assert channel in {misfit.channel for misfit in found.verdict.misfits}, found.misfits
    assert reported in found.diagnosis[0], found.diagnosis


def test_two_faults_are_both_named(experiment, fmu):
    """Friction causes the larger part of the misfit, and torques that are 1 ms late the rest."""
    simulated = rig.nonlinear(experiment, friction=0.15)
    late = {
        name: np.interp(simulated.time - 1e-3, simulated.time, simulated.outputs[name]) for name in ("tau1", "tau2")
    }
    found = prw.identify(recording(simulated._replace(outputs={**simulated.outputs, **late})), starts=1, fmu=fmu)
    first, second = found.diagnosis
    assert first.startswith("friction about pitch and roll of 0.1")
    assert second.startswith("besides, tau1") and "ms late" in second and "the argument delay: tau1,tau2" in second
    one = prw.identify(recording(simulated), starts=1, fmu=fmu)
    assert len(one.diagnosis) == 1, "one fault must have one cause"


def test_a_common_fault_is_found_if_parameters_compensate_for_each_single_one(fmu):
    # Without encoders on the shafts, torques that are 0.7 ms late change c1 by half, and the residuals look like noise.
    simulated = rig.late(rig.experiment(400004, 6, pattern="slow"), 7e-4)
    found = prw.identify(recording(simulated, ("tau1", "tau2", "pitch", "roll")), starts=1, fmu=fmu)
    assert {misfit.channel for misfit in found.verdict.misfits} == {"tau1", "tau2"}, found.misfits
    assert "(`identify` estimates it, too, with the argument delay: tau1,tau2)" in found.diagnosis[0], found.diagnosis


@pytest.mark.parametrize("pattern", ["independent", "equal", "slow", "fig4", "moves"])
def test_a_rig_without_faults_fits(fmu, pattern):
    found = prw.identify(recording(rig.experiment(30, 6, pattern=pattern)), starts=1, fmu=fmu)
    assert found.fits and not found.misfits and not found.diagnosis
    assert all(fault.size > 0 for fault in found.verdict.faults if fault.signs)
    assert not any("roll" in note and "intervals allow for" not in note for note in found.notes), found.notes
    at_rest = {c.channel for c in found.channels if c.explained is None}
    assert at_rest == {"equal": {"roll"}, "fig4": {"pitch"}}.get(pattern, set())


def test_coarse_encoders_on_the_motors_are_not_a_fault(fmu):
    # A step of 0.8 mrad changes the torque by 0.1 N.m, which hides 3 mN.m of noise.
    simulated = rig.experiment(151, 6, 250, "moves")
    found = prw.identify(recording(simulated, counts=8000, noise=0.003), starts=1, fmu=fmu)
    assert found.fits, found.misfits


@pytest.mark.parametrize(
    "fault, option, channels, size",
    [
        (("late", 1.0), "delay", ("tau1", "tau2"), 1e-3),
        (("lag", 2.0), "lag", rig.ALL, 2e-3),
        (("gain", 2.0), "gain", ("tau1",), 1.02),
    ],
)
def test_faults_are_estimated_along(experiment, fmu, fault, option, channels, size):
    found = prw.identify(recording(with_fault(experiment, *fault)), starts=1, fmu=fmu, **{option: channels})
    assert found.fits, found.misfits
    for name in channels:
        value, error = found.distortions[f"{option} of {name}"]
        assert abs(value - size) < 4.5 * error and error < 0.05 * size
    for name, estimate in found.parameters.items():
        assert abs(estimate.value - experiment.parameters[name]) < 4.5 * estimate.standard_error


@pytest.mark.parametrize(
    "friction, place",
    [((0.003, 0.003), "both input shafts"), ((0.02, 0.02), "both input shafts"), ((0.0, 0.01), "input shaft 2")],
)
def test_friction_in_the_input_shafts_is_named(fmu, friction, place):
    found = prw.identify(recording(plant.experiment(2, friction, duration=6)), starts=1, fmu=fmu)
    assert not found.fits
    name = f"friction in {place}"
    assert found.diagnosis and found.diagnosis[0].startswith(f"{name} of 0.0"), found.diagnosis
    fault = next(fault for fault in found.verdict.faults if fault.name == name)
    assert fault.size == pytest.approx(max(friction), rel=0.25)


@pytest.mark.parametrize("friction", [0.0, 0.0005, 0.001])
def test_intervals_allow_for_friction_that_is_too_small_to_be_found(fmu, friction):
    simulated = plant.experiment(2, friction, duration=6)
    found = prw.identify(recording(simulated), starts=1, fmu=fmu)
    assert found.fits, found.misfits
    for name, estimate in found.parameters.items():
        low, high = estimate.interval
        assert low < simulated.parameters[name] < high, name
        # Possible friction makes c3 less certain, because both damp the motion, but the error must stay small.
        assert estimate.relative < 0.02, name


def test_an_equal_gain_of_the_torques_is_found_if_inertias_are_known(experiment, fmu):
    """An equal gain looks like stiffer couplings with more inertia. If all inertias are estimated, the gain cannot be detected, so no
    fault is reported, with or without a gain."""
    columns = recording(experiment)
    gained = {**columns, **{name: 1.01 * columns[name] for name in ("tau1", "tau2")}}
    found = prw.identify(gained, starts=1, fmu=fmu)
    assert not found.fits and found.diagnosis[0].startswith("tau1, tau2 reads 1.01 +-"), found.diagnosis
    names = (*rig.NAMES, "J3", "H3")
    for measured, factor in ((columns, 1.0), (gained, 1.01)):
        free = prw.identify(measured, estimate=names, priors={"J2": 0.1}, starts=1, fmu=fmu)
        assert free.fits, free.misfits
        for name in rig.NAMES:
            estimate = free.parameters[name]
            assert abs(estimate.value - factor * experiment.parameters[name]) < 4.5 * estimate.standard_error, name


def test_the_command_reports_and_writes_no_parameters(prw, tmp_path, experiment):
    rig.write(tmp_path / "run.csv", rig.measure(rig.late(experiment, 1e-3), 5))
    out = tmp_path / "out" / "identified"
    result = prw("identify", "run.csv", "--starts", 1)
    reported = [line for line in result.stderr.splitlines() if not line.startswith("looking for ")]  # progress
    assert result.returncode == 3 and len(reported) == 1, result.stderr
    assert (
        "tau1, tau2" in result.stderr
        and "argument delay: tau1,tau2)" in result.stderr
        and "--write-anyway" in result.stderr
    )
    assert result.stdout.index("DOES NOT EXPLAIN") < result.stdout.index("k1 ")
    assert not (out / "identified.json").exists()
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "verdict bad" in page and "The FMU does not explain these data" in page
    result = prw("identify", "run.csv", "--starts", 1, "--write-anyway")
    assert result.returncode == 3 and (out / "identified.json").exists()
    result = prw("identify", "run.csv", "--starts", 1, "--delay", "tau1,tau2")
    assert result.returncode == 0 and "delay of tau1" in result.stdout, result.stderr


def test_a_delay_of_a_channel_that_was_not_measured(fmu, experiment):
    with pytest.raises(prw.UserError, match="delay: tau2 is not known; there are tau1"):
        prw.identify(recording(experiment, ("tau1",)), delay=["tau2"], fmu=fmu)
