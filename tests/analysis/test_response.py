"""The quantities that the fit compares: paths of the motors through their samples, and spectra of the response."""

from __future__ import annotations

import numpy as np
import pytest
import rig

from prw.identification import task_of
from prw.identification.experiment import prepare
from prw.identification.fit import Fitter
from prw.identification.path import quantum_of, smooth
from prw.identification.response import Distortion
from prw.motion import Motion
from prw.recording import Recording, read


def recording(simulated: rig.Rig, rows=slice(None), **columns) -> Recording:
    """Returns the recording of exact sensors. columns: replace recorded ones."""
    motion = Motion(simulated.time, simulated.theta, simulated.omega)
    return read({name: column[rows] for name, column in {**motion.columns, **simulated.outputs, **columns}.items()})


@pytest.fixture(scope="module")
def simulated():
    return rig.experiment(seed=4, duration=4)


def fixed(simulated: rig.Rig, model) -> dict[str, float]:
    return {name: simulated.parameters[name] for name in model.known.real}


@pytest.mark.parametrize("rows", [slice(None), slice(1234, 3235)], ids=["from rest", "in motion"])
def test_perfect_sensors_leave_nothing(model, simulated, rows):
    """The RMS of the residual is below 1e-6 of the signal's peak, also if the recording starts and ends in motion."""
    task = task_of(model.known, rig.NAMES, parameters=fixed(simulated, model), offsets=False)
    fitter = Fitter(model, [prepare(recording(simulated, rows))], task, dict.fromkeys(rig.ALL, 1.0))
    modelled = fitter.modelled(task.first())[0]
    for i, name in enumerate(rig.ALL):
        expected = simulated.outputs[name][rows]
        assert np.abs(modelled[:, i] - expected).max() < 2e-5 * np.abs(expected).max(), name
        assert np.sqrt(np.mean((modelled[:, i] - expected) ** 2)) < 1e-6 * np.abs(expected).max(), name


def test_missing_and_uneven_rows_change_nothing(model, simulated):
    keep = np.sort(np.random.default_rng(0).choice(len(simulated.time), 3000, replace=False))
    slow = np.where(np.arange(len(simulated.time)) % 10 == 0, simulated.outputs["pitch"], np.nan)
    task = task_of(model.known, rig.NAMES, parameters=fixed(simulated, model), offsets=False)
    for measured in (recording(simulated, pitch=slow), recording(simulated, keep)):
        fitter = Fitter(model, [prepare(measured)], task, dict.fromkeys(rig.ALL, 1.0))
        comparison, at = fitter.compare(task.first())[0], np.searchsorted(simulated.time, measured.time)
        left, there = np.abs(comparison.residual).max(axis=(0, 1)), np.abs(comparison.experiment.measured).max(axis=0)
        assert (left < 2e-5 * there).all(), left / there
        modelled = fitter.modelled(task.first())[0]
        np.testing.assert_allclose(modelled[20:-20, 0], simulated.outputs["tau1"][at][20:-20], atol=1e-2)


def test_derivatives_with_respect_to_the_parameters(model, simulated):
    """The derivatives that the search uses agree with finite differences, also if angles are quantised, and for distortions that filter
    a channel or change the model."""
    measured = read(rig.measure(simulated, 5, counts=2000))
    named = {"asymmetry": "c1", "delay": "tau1", "viscous": "between"}
    distortions = tuple(Distortion(kind, place) for kind, place in named.items())
    task = task_of(model.known, rig.NAMES, parameters=fixed(simulated, model), distortions=distortions)
    noise = {"tau1": 0.02, "tau2": 0.02, "theta3": 1e-3, "theta4": 1e-3, "pitch": 1e-3, "roll": 1e-3}
    fitter, at = Fitter(model, [prepare(measured)], task, noise), task.first()
    at[-3:] = 0.3, 0.01, 0.2
    found = fitter.slopes(at)
    step = 1e-5
    for i, direction in enumerate(np.eye(len(at))):
        differences = (fitter.residuals(at + step * direction) - fitter.residuals(at - step * direction)) / (2 * step)
        # Kaufman's approximation omits a term that is proportional to the residual.
        assert np.linalg.norm(found[:, i] - differences) < 5e-3 * np.linalg.norm(differences), task.unknowns[i]


def wave(t):
    """Returns angle and rate of a motion of 0.3 rad with frequencies up to 10 Hz."""
    f, a = np.array([0.7, 3.1, 9.7]), np.array([0.25, 0.04, 0.01])
    phase = 2 * np.pi * np.outer(t, f) + [0.1, 2.0, 4.0]
    return np.sin(phase) @ a, np.cos(phase) @ (2 * np.pi * f * a)


@pytest.mark.parametrize("counts", [1000, 10_000])
def test_quantised_angles(counts):
    t = np.arange(8001) * 1e-3
    angle, rate = wave(t)
    quantum = 2 * np.pi / counts
    path = smooth(t, np.round(np.round(angle / quantum) * quantum, 6))
    assert path.quantum == pytest.approx(quantum, rel=1e-3)
    assert path.noise == pytest.approx(quantum / np.sqrt(12), rel=0.05)
    assert np.std(path.angle(t) - angle) < 0.6 * quantum / np.sqrt(12)
    raw = np.std(np.gradient(np.round(angle / quantum) * quantum, t) - rate)
    assert np.std(path.angle.derivative()(t) - rate) < raw / 4
    lines = np.exp(-2j * np.pi * np.outer([0.7, 3.1, 9.7], t[:7000]))
    gain = (lines @ path.angle(t)[:7000]) / (lines @ angle[:7000])
    np.testing.assert_allclose(np.abs(gain), 1, atol=0.01)


def test_exact_angles_are_followed():
    t = np.arange(4001) * 1e-3
    angle, rate = wave(t)
    path = smooth(t, angle)
    assert path.quantum == 0
    assert np.abs(path.angle(t) - angle).max() < 1e-9
    assert np.abs(path.angle.derivative()(t) - rate)[5:-5].max() < 1e-4


def test_logged_rates_help_and_their_noise_is_found():
    t = np.arange(8001) * 1e-3
    angle, rate = wave(t)
    quantum = 2 * np.pi / 2000
    coarse = np.round(angle / quantum) * quantum
    random = np.random.default_rng(0)
    without_rates = smooth(t, coarse)
    both = smooth(t, coarse, rate + random.normal(0, 0.03, len(t)))
    assert both.rate_noise == pytest.approx(0.03, rel=0.1)
    errors = [np.std(path.angle.derivative()(t) - rate) for path in (without_rates, both)]
    assert errors[1] < errors[0] / 3


def test_errors_drawn_at_two_angles_differ():
    """If a motor rests at an angle, the encoder's error is any value up to half a quantum. At two angles it is drawn independently."""
    t = np.arange(4001) * 1e-3
    quantum = 2 * np.pi / 10_000
    angle = 0.4 / (1 + np.exp(-(t - 2) / 0.02))
    path = smooth(t, np.round(angle / quantum) * quantum)
    random = np.random.default_rng(0)
    differences = [np.ptp(path.errors(random)[[1000, 3000]]) for _ in range(200)]
    # The difference of two uniform errors has an RMS of sqrt(2 / 12) quanta.
    assert np.sqrt(np.mean(np.square(differences))) == pytest.approx(quantum / np.sqrt(6), rel=0.2)


def test_uneven_samples_and_a_gap():
    random = np.random.default_rng(3)
    t = np.sort(random.uniform(0, 8, 5000))
    t = t[(t < 3) | (t > 3.05)]
    angle, rate = wave(t)
    path = smooth(t, angle + random.normal(0, 1e-4, len(t)))
    even = np.linspace(0.1, 7.9, 4000)
    assert path.noise == pytest.approx(1e-4, rel=0.1)
    assert np.std(path.angle(even) - wave(even)[0]) < 3e-4


@pytest.mark.parametrize("values", [np.zeros(100), np.full(100, 0.3), np.linspace(0, 1, 100)])
def test_a_motor_that_rests_or_turns_evenly(values):
    path = smooth(np.arange(100) * 1e-2, values)
    assert np.abs(path.angle(np.arange(100) * 1e-2) - values).max() < 1e-6


def test_quanta():
    random = np.random.default_rng(0)
    assert quantum_of(random.normal(size=1000)) == 0
    assert quantum_of(0.1 + 0.25 * random.integers(0, 40, 1000)) == pytest.approx(0.25)
    assert quantum_of(np.round(0.000628 * random.integers(-500, 500, 5000), 6)) == pytest.approx(0.000628, rel=1e-3)


@pytest.mark.parametrize("counts", [4096, 65_536])
def test_periodic_errors_of_an_encoder_are_not_taken_for_motion(counts):
    """In Fig. 4 a motor moves at 5 Hz only, so its quantisation errors are at multiples of 5 Hz. They must not widen the band."""
    t = np.arange(10_001) * 1e-3
    quantum = 2 * np.pi / counts
    angle = (1 - np.cos(10 * np.pi * t)) / (10 * np.pi)
    theta = np.round(np.outer(angle, [1, -1]) / quantum + [0.3, 0.1]) * quantum
    assert quantum_of(theta[:, 0]) == pytest.approx(quantum)
    found = prepare(read({"time": t, "theta1": theta[:, 0], "theta2": theta[:, 1], "tau1": angle}))
    assert 5 < found.band < 8
