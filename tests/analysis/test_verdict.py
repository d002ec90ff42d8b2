"""Data that the model does not explain are detected, and their faults are named."""

from __future__ import annotations

import re

import numpy as np
import plant
import pytest
import rig
from monte_carlo import with_fault

import prw
from prw.identification.diagnosis import INERTIAS, _flat, sums_of_inertias
from prw.identification.kinds import KINDS
from prw.identification.verdict import hypotheses


def recording(simulated, channels=rig.ALL, **sensors) -> dict[str, np.ndarray]:
    return rig.measure(simulated, 5, channels, **sensors)


#: Faults of monte_carlo.FAULTS with their sizes, channels that have misfits, and a part of the diagnosis.
FAULTY_RIGS = {
    ("late", 1.0): (["tau1", "tau2"], "ms late"),
    ("late", 0.1): (["tau1", "tau2"], "ms late"),
    ("lag", 2.0): (list(rig.ALL), "lags with a time constant of 2 +-"),
    ("gain", 2.0): (["tau1"], "tau1 reads 1.02"),
    ("backlash", 2.0): (["theta3"], "backlash at the motors of 2.00"),
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
    "sign of a motor": (
        lambda c: {"theta2": -c["theta2"]},
        "tau2",
        "theta2 has the wrong sign: all channels follow the FMU if the sign is changed",
    ),
    "sign": (lambda c: {"theta3": -c["theta3"]}, "theta3", "theta3 has the wrong sign"),
    "swapped": (lambda c: {"tau1": c["tau2"], "tau2": c["tau1"]}, "tau2", "tau1 and tau2 are swapped"),
    "stuck": (
        lambda c: {"pitch": np.concatenate([c["pitch"][:2000], np.full(600, c["pitch"][2000]), c["pitch"][2600:]])},
        "pitch",
        "pitch is stuck from 2 to 2.599 s",
    ),
    "fading": (
        lambda c: {"tau2": c["tau2"] * (1 - 0.02 * c["time"] / c["time"][-1])},
        "tau2",
        "fading of tau2 of ",
    ),
    # 5 standard errors, a little more than are a misfit.
    "hardly any fading": (
        lambda c: {"tau2": c["tau2"] * (1 - 0.0008 * c["time"] / c["time"][-1])},
        "tau2",
        "fading of tau2 of ",
    ),
    "crosstalk": (
        lambda c: {"tau1": c["tau1"] + 0.01 * c["tau2"], "tau2": c["tau2"] + 0.01 * c["tau1"]},
        "tau1",
        "crosstalk between tau1 and tau2 of ",
    ),
}
#: Rigs with what reality adds: fields of plant.Case, the property that the fit includes, and its true size in SI.
REAL_RIGS = {
    "friction": ({"friction": (0.02, 0.02)}, "friction in both input shafts", 0.02),
    "little friction": ({"friction": (0.003, 0.003)}, "friction in both input shafts", 0.003),
    "friction of a shaft": ({"friction": (0.0, 0.01)}, "friction in input shaft 2", 0.01),
    "friction of the output": ({"output_friction": 0.02}, "friction about pitch and roll", 0.02),
    "backlash": ({"play": (0.002, 0.0)}, "backlash in the couplings k1", 0.002),
    "backlash of k2": ({"play": (0.0, 0.004)}, "backlash in the couplings k2", 0.004),
    "cubic stiffness": ({"cubic": (0.0, 20.0)}, "cubic stiffness of the couplings k2", 20.0),
    "unequal springs": ({"sides": (1.0, 1.03, 1.0, 1.0)}, "excess of k2 on side 2 over side 1", 0.03),
    "unequal dampers": ({"sides": (1.0, 1.0, 0.85, 1.0)}, "excess of c1 on side 2 over side 1", -0.15),
    "viscous friction": ({"viscous": (0.03, 0.0)}, "viscous friction in both input shafts", 0.03),
    "viscous friction between": (
        {"viscous": (0.0, 0.03)},
        "viscous friction of both shafts between the couplings",
        0.03,
    ),
    "softer spring": ({"falling": 0.04}, "", 0.0),
    "hardly unequal springs": ({"sides": (1.003, 1.0, 1.0, 1.0)}, "", 0.0),
    "undetectable friction": ({"friction": (0.001, 0.001)}, "", 0.0),
    "hardly any friction": ({"friction": (0.0005, 0.0005)}, "", 0.0),
    "nothing": ({}, "", 0.0),
    "inertia": ({"inertia": (1.05, 1.05, 1.05)}, "", 0.0),
    "softening": ({"softening": 0.05}, "", 0.0),
}


#: The rigs of REAL_RIGS in the tests that `make test` runs.
QUICK_RIGS = (
    "friction",
    "backlash of k2",
    "unequal springs",
    "undetectable friction",
    "softening",
    "softer spring",
    "hardly unequal springs",
)


class RealRigs:
    """The rigs of REAL_RIGS by name. Those of QUICK_RIGS are simulated together, and the others when the first of them is needed."""

    def __init__(self):
        self.simulated: dict[str, rig.Rig] = {}

    def __getitem__(self, name: str) -> rig.Rig:
        if name not in self.simulated:
            group = [each for each in REAL_RIGS if (each in QUICK_RIGS) == (name in QUICK_RIGS)]
            cases = [plant.Case(2, **REAL_RIGS[each][0]) for each in group]
            self.simulated |= zip(group, plant.experiments(cases, 6.0))
        return self.simulated[name]


@pytest.fixture(scope="module")
def real_rigs():
    return RealRigs()


def quickly(cases, *quick):
    """The cases as parameters of tests, of which `make test` runs the quick ones."""
    return [pytest.param(case, marks=[] if case in quick else pytest.mark.long, id=named(case)) for case in cases]


def named(case) -> str:
    return case if isinstance(case, str) else f"{case[0]} {case[1]:g}"


@pytest.mark.parametrize("fault", quickly(FAULTY_RIGS, ("late", 1.0), ("gain", 2.0)))
def test_a_rig_with_a_fault_does_not_fit(experiment, fmu, fault):
    channels, reported = FAULTY_RIGS[fault]
    found = prw.identify(recording(with_fault(experiment, *fault)), starts=1, fmu=fmu)
    assert not found.fits
    assert set(channels) <= {misfit.channel for misfit in found.verdict.misfits}, found.misfits
    assert any(reported in cause for cause in found.diagnosis), found.diagnosis


@pytest.mark.parametrize(
    "fault", quickly(FAULTY_COLUMNS, "clipped", "degrees", "sign", "swapped", "stuck", "hardly any fading")
)
def test_a_faulty_column_is_named(experiment, fmu, fault):
    change, channel, reported = FAULTY_COLUMNS[fault]
    columns = recording(experiment)
    found = prw.identify({**columns, **change(columns)}, degrees=False, starts=1, fmu=fmu)
    assert channel in {misfit.channel for misfit in found.verdict.misfits}, found.misfits
    assert reported in found.diagnosis[0], found.diagnosis
    if "is cut off" in reported:
        assert "is cut off at -3" in found.diagnosis[1], "both ends are named"


def test_a_shaft_that_rests_while_the_other_one_moves_is_not_stuck():
    time = np.arange(3000) / 1000
    angle = 0.3 * np.where(time < 1, time, np.where(time < 1.6, 1.0, time - 0.6))
    column, moving = 1e-4 * np.round(angle / 1e-4), np.ones(len(time), dtype=bool)
    assert not list(_flat("theta3", time, column, moving, angle, hidden=5e-4))
    (message,) = _flat("theta3", time, column, moving, 0.3 * time, hidden=5e-4)
    assert message.startswith("theta3 is stuck from 1 to 1.6")


@pytest.mark.parametrize("cut, messages", [(0.0, []), (0.002, ["theta3 is cut off at 0.2982 (SI), 4 times: "])])
def test_an_encoder_whose_angle_turns_does_not_saturate(cut, messages):
    """An encoder with coarse steps shows some equal values at both ends of a slow motion, with or without saturation."""
    time, quantum = np.arange(4000) / 1000, 6e-4
    angle = 0.3 * np.sin(2 * np.pi * time)
    column = np.minimum(quantum * np.round(angle / quantum), quantum * np.round((0.3 - cut) / quantum))
    found = list(_flat("theta3", time, column, np.ones(len(time), dtype=bool), angle, hidden=3e-3))
    assert [each[: len(message)] for each, message in zip(found, messages, strict=True)] == messages


@pytest.mark.long
def test_two_faults_are_both_named(experiment, fmu):
    """Friction causes the larger part of the misfit, and torques that are 1 ms late the rest."""
    simulated = rig.nonlinear(experiment, friction=0.15)
    late = {
        name: np.interp(simulated.time - 1e-3, simulated.time, simulated.outputs[name]) for name in ("tau1", "tau2")
    }
    found = prw.identify(recording(simulated._replace(outputs={**simulated.outputs, **late})), starts=1, fmu=fmu)
    first, second = found.diagnosis
    assert first.startswith("friction about pitch and roll of 0.15") and '`friction=["output"]`' in first
    assert second.startswith("besides, tau1") and "ms late" in second and '`delay=["tau1", "tau2"]`' in second
    # With both, the parameters are those of the rig.
    both = {"friction": ["output"], "delay": ["tau1", "tau2"]}
    columns = recording(simulated._replace(outputs={**simulated.outputs, **late}))
    assert_contains(prw.identify(columns, starts=1, fmu=fmu, **both), experiment)


def assert_contains(found, simulated) -> None:
    """Asserts that the data are explained, and that the estimates are within 4.5 standard errors of the rig's parameters."""
    assert found.fits, found.misfits
    for name, estimate in found.parameters.items():
        assert abs(estimate.value - simulated.parameters[name]) < 4.5 * estimate.standard_error, name


@pytest.mark.parametrize(
    "name",
    quickly([name for name, (_, added, _) in REAL_RIGS.items() if added], *QUICK_RIGS),
)
def test_what_the_rig_adds_is_estimated(real_rigs, fmu, name):
    _, added, size = REAL_RIGS[name]
    found = prw.identify(recording(real_rigs[name]), starts=1, fmu=fmu)
    assert_contains(found, real_rigs[name])
    (addition,) = found.additions
    assert addition.startswith(f"{added} of ") and addition in found.summary() and not found.diagnosis
    value, error = found.distortions[added]
    assert abs(value - size) < 4.5 * error < 0.5 * abs(size)


def test_friction_is_estimated_on_request(real_rigs, fmu):
    found = prw.identify(recording(real_rigs["undetectable friction"]), friction=["shafts"], starts=1, fmu=fmu)
    assert_contains(found, real_rigs["undetectable friction"])
    value, error = found.distortions["friction in both input shafts"]
    assert abs(value - 0.001) < 4.5 * error < 0.002


def test_a_decreasing_stiffness_is_named_and_estimated_on_request(real_rigs, fmu):
    columns = recording(real_rigs["softer spring"])
    found = prw.identify(columns, starts=1, fmu=fmu)
    assert not found.fits and not found.additions
    assert any(cause.startswith("decrease of k2 over the recording of") for cause in found.diagnosis), found.diagnosis
    found = prw.identify(columns, softening=["k2"], starts=1, fmu=fmu)
    assert_contains(found, real_rigs["softer spring"])
    value, error = found.distortions["decrease of k2 over the recording"]
    assert abs(value - 0.04) < 4.5 * error < 0.02


def test_the_inertias_that_turn_in_pitch_and_in_roll_are_known_better_than_each_inertia(experiment, fmu):
    wrong = {name: experiment.parameters[name] / 1.05 for name in ("J2", "J3", "H3")}
    priors = dict.fromkeys(wrong, 0.1)
    found = prw.identify(recording(experiment), parameters=wrong, priors=priors, starts=1, fmu=fmu)
    assert_contains(found, experiment)
    for each in sums_of_inertias(found.solution):
        assert abs(each.off - 0.05) < 4.5 * each.error < 0.02
        assert all(each.error < found.parameters[name].relative / 5 for name in wrong)


@pytest.mark.long
def test_wrong_inertias_are_named_beside_a_gain_of_the_torques(real_rigs, fmu):
    columns = recording(real_rigs["inertia"])
    found = prw.identify(columns, starts=1, fmu=fmu)
    assert not found.fits
    named = " ".join(found.diagnosis)
    sizes = re.findall(r"(J2 \+ [\d.]+ [JH]3) \+([\d.]+) \+- ([\d.]+) % in (?:pitch|roll)", named)
    assert [name for name, *_ in sizes] == ["J2 + 0.5 H3", "J2 + 1.531 J3"], named
    assert all(abs(float(off) - 5) < 4.5 * float(error) < 2 for _, off, error in sizes), named
    assert '`priors={"J2": 0.1, "J3": 0.1, "H3": 0.1}`' in named and '`gain=["tau1", "tau2"]`' in named, named
    assert_contains(
        prw.identify(columns, priors=dict.fromkeys(("J2", "J3", "H3"), 0.1), starts=1, fmu=fmu), real_rigs["inertia"]
    )
    # With the gain, the data fit, too, so the intervals contain both solutions, and a note reports it.
    gained = prw.identify(columns, gain=["tau1", "tau2"], starts=1, fmu=fmu)
    assert_contains(gained, real_rigs["inertia"])
    assert any("inertias" in note for note in gained.notes), gained.notes


def test_a_change_over_time_is_named(real_rigs, fmu, tmp_path):
    found = prw.identify(recording(real_rigs["softening"]), starts=1, fmu=fmu)
    assert not found.fits and found.diagnosis[0].startswith("k1 changes over time"), found.diagnosis
    before, after = (part.value("k1")[0] for part in found.parts)
    assert after / before == pytest.approx(0.95, abs=0.004)
    found.report(tmp_path / "report.html")
    assert "Parameters over time" in (tmp_path / "report.html").read_text(encoding="utf-8")


#: Disturbances of a column that leave the estimates correct, and a part of the note.
DISTURBED = {
    "hum": (lambda c: {"tau1": c["tau1"] + 0.02 * np.sin(2 * np.pi * 50 * c["time"])}, "tau1 contains hum of 50 Hz"),
    "spikes": (
        lambda c: {"roll": c["roll"] + 0.1 * (np.arange(len(c["roll"])) % 600 == 300)},
        "roll has spikes in 10 rows",
    ),
}


@pytest.mark.parametrize("disturbance", DISTURBED)
def test_a_disturbance_is_noted(experiment, fmu, disturbance):
    change, note = DISTURBED[disturbance]
    columns = recording(experiment)
    found = prw.identify({**columns, **change(columns)}, starts=1, fmu=fmu)
    assert_contains(found, experiment)
    assert any(note in each for each in found.notes), found.notes


@pytest.mark.parametrize(
    "frequency, given, subtracted",
    [
        (49.83, 50.0, ["recording: hum of tau1 of 49.83 Hz with an amplitude of 0.3 N.m is subtracted"]),
        (16.77, 16.77, []),
    ],
)
def test_hum_is_estimated_on_request(experiment, fmu, frequency, given, subtracted):
    columns = recording(experiment)
    humming = {**columns, "tau1": columns["tau1"] + 0.3 * np.sin(2 * np.pi * frequency * columns["time"] + 1)}
    found = prw.identify(humming, hum={"tau1": given}, starts=1, fmu=fmu)
    assert_contains(found, experiment)
    without = prw.identify(columns, starts=1, fmu=fmu)
    assert found.channels[0].residual == pytest.approx(without.channels[0].residual, rel=0.01)
    assert [note for note in found.notes if "hum" in note] == subtracted


@pytest.mark.parametrize("given", [50.0, 16.7])
def test_hum_that_is_not_there_changes_nothing(experiment, fmu, given):
    columns = recording(experiment)
    found, without = (prw.identify(columns, hum=hum, starts=1, fmu=fmu) for hum in ({"tau1": given}, {}))
    assert [note for note in found.notes if note not in without.notes] == [
        f"recording: no hum of tau1 is found {'near 50 Hz, so nothing is subtracted' if given == 50 else 'at 16.7 Hz, so none is estimated'}"
    ]
    assert found.values == without.values


def spoiled(columns: dict[str, np.ndarray], share: float) -> dict[str, np.ndarray]:
    """The columns, in which a share of the values of a torque, an encoder and an inertial sensor is replaced by a value far off."""
    random, rows = np.random.default_rng(3), len(columns["time"])
    off = {"tau1": 5.0, "theta4": 0.0, "roll": -0.4}
    return {**columns, **{n: np.where(random.random(rows) < share, x, columns[n]) for n, x in off.items()}}


@pytest.mark.parametrize("share", [pytest.param(0.001, marks=pytest.mark.long), 0.01])
def test_outliers_count_less_on_request(experiment, fmu, share):
    columns = recording(experiment)
    plain, found = (prw.identify(spoiled(columns, share), robust=robust, starts=1, fmu=fmu) for robust in (False, True))
    assert not plain.fits and any("let them count less (robust)" in note for note in plain.notes), plain.notes
    assert_contains(found, experiment)
    assert not any("spikes" in note for note in found.notes), found.notes
    counted = [note for note in found.notes if "standard deviations from the model" in note]
    assert [note.split(" of ")[1].split()[0] for note in counted] == ["tau1", "theta4", "roll"], counted
    # Without outliers, the loss costs hardly anything.
    clean = prw.identify(columns, starts=1, fmu=fmu)
    for name, estimate in found.parameters.items():
        assert estimate.relative < 1.3 * clean.parameters[name].relative, name


def test_hum_of_a_channel_that_was_not_measured(experiment, fmu):
    with pytest.raises(prw.UserError, match="hum: tau9 is not known"):
        prw.identify(recording(experiment), hum={"tau9": 50}, fmu=fmu)


def test_a_channel_that_is_not_explained_is_a_misfit(experiment, fmu):
    """Its residual is above the compared frequencies, so no other test detects it."""
    columns = recording(experiment)
    pitch = columns["pitch"] + np.sin(2 * np.pi * 200 * columns["time"])
    found = prw.identify({**columns, "pitch": pitch}, starts=1, fmu=fmu)
    assert [misfit.channel for misfit in found.verdict.misfits] == ["pitch"], found.misfits
    assert "as large as the motion" in found.misfits[0] and "none of these explains the data" in found.summary()
    # Each hypothesis was either tried or is listed among the others.
    tried, others = found.explanation.tried, found.explanation.left_out
    assert "; not tried, because less was expected of them: " in found.summary() and others
    kinds = (*KINDS, "drift")
    names = [str(each) for kind in kinds for each in hypotheses(found.solution, kind)] + [str(INERTIAS)]
    assert sorted([*tried, *others]) == sorted(names)


def test_a_turned_inertial_sensor_is_explained(experiment, fmu):
    columns, angle = recording(experiment), np.radians(0.3)
    turned = [
        np.cos(angle) * columns["pitch"] + np.sin(angle) * columns["roll"],
        np.cos(angle) * columns["roll"] - np.sin(angle) * columns["pitch"],
    ]
    found = prw.identify({**columns, **dict(zip(("pitch", "roll"), turned))}, starts=1, fmu=fmu)
    assert_contains(found, experiment)
    ((value, error),) = found.distortions.values()
    assert abs(value - angle) < 4.5 * error < 0.1 * angle and " deg" in found.additions[0]


def test_drifting_sensors_and_wrapped_angles_are_explained(experiment, fmu):
    columns, turn = recording(experiment), 2 * np.pi
    slope = np.linspace(0, 1, len(columns["time"]))
    drifting = {**columns, "theta3": columns["theta3"] + 0.01 * slope, "tau2": columns["tau2"] + 0.2 * slope**2}
    found = prw.identify(drifting, starts=1, fmu=fmu)
    assert_contains(found, experiment)
    assert found.additions == ["slow drift of theta3, tau2"] or found.additions == ["slow drift of tau2, theta3"]
    angles = {name: columns[name] % turn for name in ("theta1", "theta2", "theta3", "theta4")}
    found = prw.identify({**columns, **angles}, starts=1, fmu=fmu)
    assert_contains(found, experiment)
    assert sum("restarts after full turns" in note for note in found.notes) == 4


def test_a_common_fault_is_found_if_parameters_compensate_for_each_single_one(fmu):
    # Without encoders on the shafts, torques that are 0.7 ms late change c1 by half, and the residuals look like noise.
    simulated = rig.late(rig.experiment(400004, 6, pattern="slow"), 7e-4)
    found = prw.identify(recording(simulated, ("tau1", "tau2", "pitch", "roll")), starts=1, fmu=fmu)
    assert {misfit.channel for misfit in found.verdict.misfits} == {"tau1", "tau2"}, found.misfits
    assert '(to estimate it, add `delay=["tau1", "tau2"]`)' in found.diagnosis[0], found.diagnosis


@pytest.mark.parametrize("pattern", quickly(["independent", "equal", "slow", "fig4", "moves"], "equal", "moves"))
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
        pytest.param(("lag", 2.0), "lag", rig.ALL, 2e-3, marks=pytest.mark.long),
        pytest.param(("gain", 2.0), "gain", ("tau1",), 1.02, marks=pytest.mark.long),
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


SMALL_EFFECTS = ("nothing", "hardly any friction", "undetectable friction", "hardly unequal springs")


@pytest.mark.parametrize("name", quickly(SMALL_EFFECTS, *QUICK_RIGS))
def test_intervals_allow_for_what_is_too_small_to_be_found(real_rigs, fmu, name):
    found = prw.identify(recording(real_rigs[name]), starts=1, fmu=fmu)
    assert found.fits and not found.additions, found.misfits
    for parameter, estimate in found.parameters.items():
        low, high = estimate.interval
        assert low < real_rigs[name].parameters[parameter] < high, parameter
        # Possible friction makes c3 less certain, because both damp the motion, but the error must stay small.
        assert estimate.relative < 0.02, parameter


def test_an_equal_gain_of_the_torques_is_found_if_inertias_are_known(experiment, fmu):
    """An equal gain looks like stiffer couplings with more inertia. If all inertias are estimated, the gain cannot be detected, so no
    fault is reported, with or without a gain."""
    columns = recording(experiment)
    gained = {**columns, **{name: 1.01 * columns[name] for name in ("tau1", "tau2")}}
    found = prw.identify(gained, starts=1, fmu=fmu)
    assert not found.fits and any("tau1, tau2 reads 1.01 +-" in cause for cause in found.diagnosis), found.diagnosis
    names = (*rig.NAMES, "J3", "H3")
    for measured, factor in ((columns, 1.0), (gained, 1.01)):
        free = prw.identify(measured, estimate=names, priors={"J2": 0.1}, starts=1, fmu=fmu)
        assert free.fits, free.misfits
        for name in rig.NAMES:
            estimate = free.parameters[name]
            assert abs(estimate.value - factor * experiment.parameters[name]) < 4.5 * estimate.standard_error, name


def test_the_command_reports_and_writes_no_parameters(prw, tmp_path):
    rig.write(tmp_path / "run.csv", rig.measure(rig.late(rig.experiment(1, 3), 1e-3), 5, ("tau1", "tau2", "theta3")))
    out = tmp_path / "out" / "identified"
    result = prw("identify", "run.csv", "--starts", 1)
    reported = [line for line in result.stderr.splitlines() if not line.startswith("looking for ")]  # progress
    assert result.returncode == 3 and len(reported) == 1, result.stderr
    assert (
        "tau1, tau2" in result.stderr
        and "add `--delay tau1,tau2`)" in result.stderr
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


@pytest.mark.long
def test_advice_is_followed_in_steps_until_it_is_ambiguous(real_rigs, experiment, fmu):
    """A delay is assumed in one step. A gain of all torques and wrong inertias have the same effect, so neither is assumed."""
    found = prw.identify(recording(with_fault(experiment, "late", 1.0)), starts=1, follow=2, fmu=fmu)
    assert_contains(found, experiment)
    (assumed,) = found.assumed
    assert "ms late" in assumed and not found.stopped and "steps that the notes list are assumed" in found.summary()
    found = prw.identify(recording(real_rigs["inertia"]), starts=1, follow=2, fmu=fmu)
    assert not found.fits and not found.assumed and "weigh the parts" in found.stopped
    assert f"note        the next step was not taken: {found.stopped}" in found.summary()
    assert "\ntry first " in found.summary() and "\nperhaps " in found.summary()


def test_a_delay_of_a_channel_that_was_not_measured(fmu, experiment):
    with pytest.raises(prw.UserError, match="delay: tau2 is not known; there are tau1"):
        prw.identify(recording(experiment, ("tau1",)), delay=["tau2"], fmu=fmu)
