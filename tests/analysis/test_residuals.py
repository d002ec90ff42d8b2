"""Notes on the residuals of encoders: rounding is quiet at rest and noisy in motion, which is neither jitter nor a spike."""

from __future__ import annotations

import re
from types import SimpleNamespace

import numpy as np
import pytest

from prw.identification.residuals import notes_on_residuals

#: Channels, the steps of their encoders (0: none), and their noise.
CHANNELS = {"tau1": (0.0, 0.02), "theta3": (6.283e-4, 0.0), "theta4": (1.5e-3, 0.0), "roll": (0.0, 1e-3)}


def angles(time):
    """A chirp from 0.1 to 15 Hz, after a rest, as every channel has it."""
    phase = np.where(time > 0.5, 2 * np.pi * (0.1 * (time - 0.5) + 2.5 * (time - 0.5) ** 2), 0.0)
    return 0.2 * (1 - np.cos(phase))[:, None] / np.maximum(1, 0.5 * time)[:, None] * np.ones(len(CHANNELS))


def recorded(rate, seed, jitter=0.0):
    """An experiment of 3 s as `notes_on_residuals` takes it, and the exact values at its times."""
    random, time = np.random.default_rng(seed), np.arange(3 * rate) / rate
    values = angles(time + jitter * random.normal(size=len(time)))
    for i, (quantum, noise) in enumerate(CHANNELS.values()):
        values[:, i] += random.normal(0, noise, len(time)) if noise else 0.0
        if quantum:
            values[:, i] = np.round(values[:, i] / quantum + random.uniform()) * quantum
    power = np.array([[quantum**2 / 12 for quantum, _ in CHANNELS.values()]])
    experiment = SimpleNamespace(
        channels=tuple(CHANNELS), sampled=time, values=values, channel_power=power, limited=False
    )
    return experiment, angles(time)


@pytest.mark.parametrize("rate", [200, 1000, 5000])
@pytest.mark.parametrize("seed", range(4))
def test_encoders_cause_no_notes(rate, seed):
    assert notes_on_residuals(*recorded(rate, seed)) == []


@pytest.mark.parametrize("rate", [1000, 5000])
def test_jitter_is_found_with_encoders(rate):
    (note,) = notes_on_residuals(*recorded(rate, 1, jitter=4e-4))
    size = re.match(r"the sampling times seem to jitter by about (\S+) ms", note)
    assert size and 0.3 < float(size[1]) < 0.5, note


def test_jitter_does_not_hide_hum():
    experiment, exact = recorded(1000, 2, jitter=4e-4)
    experiment.values[:, 0] += 0.02 * np.sin(2 * np.pi * 50 * experiment.sampled)
    jitter, hum = notes_on_residuals(experiment, exact)
    assert "jitter" in jitter and hum.startswith("tau1 contains hum of 50 Hz")


def test_spikes_return_and_impacts_stay():
    """A spike is a note. The torque of parts that strike each other is not, whether the model contains the impact or not."""
    experiment, exact = recorded(1000, 3)
    experiment.values[[700, 1900], 1] += 0.05
    (note,) = notes_on_residuals(experiment, exact)
    assert note.startswith("theta3 has spikes in 2 rows, the largest of 0.05 rad")
    experiment, exact = recorded(1000, 3)
    time = experiment.sampled
    impact = np.where(time >= 1.2, 2.0 * np.exp(-np.abs(time - 1.2) / 3e-3), 0.0)
    experiment.values[:, 0] += impact
    assert notes_on_residuals(experiment, exact) == []
    # The model may strike a row too early.
    exact[:, 0] += np.roll(impact, -1)
    assert notes_on_residuals(experiment, exact) == []
