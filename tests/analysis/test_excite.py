"""`prw excite`: motions within the limits, ranked by the standard errors that fits really have."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from prw.identification import design, task_of
from prw.identification.experiment import planned
from prw.identification.fit import fit
from prw.recording import read
from prw.testbed import Testbed


def test_motions_keep_the_limits_and_start_and_end_at_rest(model):
    limits = design.Limits(0.3, 5.0, 150.0)
    noise = {"tau1": 0.02, "tau2": 0.02}
    for motion in design.motions(model, task_of(model.known, ["k1", "c3"]), limits, 6.0, 1000.0, noise):
        assert np.abs(motion.theta).max() <= limits.angle * 1.001, motion.name
        assert np.abs(motion.omega).max() <= limits.rate * 1.001, motion.name
        acceleration = np.diff(motion.omega, axis=0) * 1000
        assert np.abs(acceleration).max() <= limits.acceleration * 1.05, motion.name
        used = [np.abs(motion.theta).max() / 0.3, np.abs(motion.omega).max() / 5, np.abs(acceleration).max() / 150]
        assert max(used) > 0.95, f"{motion.name} leaves all limits unused"
        for row in (0, -1):
            assert np.abs(motion.theta[row]).max() < 1e-12 and np.abs(motion.omega[row]).max() < 1e-6, motion.name
        slope = np.gradient(motion.theta, motion.time, axis=0)[2:-2]
        assert np.abs(slope - motion.omega[2:-2]).max() < 0.02 * limits.rate, f"{motion.name}: omega is not theta'"


def test_the_expected_errors_are_those_of_many_fits(model, fmu):
    """With white noise and exact angles, the scatter of 16 fits is 0.6 to 1.5 times the standard errors that the design expects."""
    channels = ("tau1", "tau2", "pitch")
    noise = {"tau1": 0.05, "tau2": 0.05, "pitch": 2e-3}
    task = task_of(model.known, ["k2", "c2", "c3"])
    motions = design.motions(model, task, design.Limits(0.3, 5.0, 150.0), 2.0, 250.0, noise)
    motion = next(m for m in motions if m.name == "chirp_independent")
    experiment = planned(motion, channels)
    point = task.first()
    expected = np.sqrt(np.diag(np.linalg.inv(design.information(model, [experiment], task, point, noise))))
    with Testbed(fmu) as testbed:
        signals = testbed.respond(motion, channels)
    response = np.column_stack([signals[name] for name in channels])
    random = np.random.default_rng(0)
    found = []
    for _ in range(16):
        values = response + random.normal(0, list(noise.values()), response.shape) + random.uniform(-1, 1, 3)
        found.append(fit(model, [replace(experiment, values=values)], task, starts=1).logarithms - point)
    ratio = np.std(found, axis=0) / expected
    assert (ratio > 0.6).all() and (ratio < 1.5).all(), ratio


def test_command(prw, tmp_path):
    result = prw("excite", "--measure", "tau1,tau2", "--duration", 4, "--rate", 500, "--angle", 20)
    assert result.returncode == 0 and result.stderr == "", result.stderr
    out = tmp_path / "out" / "excite"
    ranking = json.loads((out / "ranking.json").read_text())
    typical = [entry["typical_error"] for entry in ranking["motions"]]
    assert typical == sorted(typical) and len(typical) >= 10
    for entry in ranking["motions"]:
        motion = read(out / entry["file"])
        assert motion.omega is not None and motion.time[-1] == 4.0
        assert np.abs(motion.theta).max() <= np.deg2rad(20.001) and np.abs(motion.omega).max() <= np.deg2rad(450.01)
        assert list(entry["expected_errors"]) == ["k1", "k2", "c1", "c2", "c3"]
    best = ranking["motions"][0]["file"]
    assert prw("simulate", "--input", out / best).returncode == 0


def test_only_opposite_motors_determine_the_roll_inertia(prw, tmp_path):
    result = prw("excite", "--measure", "tau1,tau2", "--estimate", "J3", "--duration", 4, "--rate", 500)
    assert result.returncode == 0
    motions = json.loads((tmp_path / "out" / "excite" / "ranking.json").read_text())["motions"]
    assert "equal" not in motions[0]["file"]
    equal = [entry for entry in motions if entry["file"].endswith("_equal.csv")]
    assert all(entry["undetermined"] for entry in equal)


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["--measure", "tau3"], "--measure: tau3 is not known"),
        (["--angle", "0"], "--angle: 0.0 is not a finite number above 0"),
        (["--duration", "1"], "--duration 1: it must be 2 s or more"),
        (["--rate", "10"], "--rate 10: the testbed moves at up to 30 Hz"),
    ],
)
def test_wrong_options(prw, arguments, message):
    result = prw("excite", *arguments)
    assert result.returncode == 1 and message in result.stderr and result.stderr.count("\n") == 1
