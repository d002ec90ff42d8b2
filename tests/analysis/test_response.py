"""What the fit compares with a recording: the FMU's answer, as spectra, against equations of motion of another origin."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rig

from prw.errors import UserError
from prw.identification import task_of
from prw.identification.experiment import prepare
from prw.identification.fit import Fitter
from prw.motion import Motion
from prw.recording import Recording

OTHER = {"k1": 90.0, "k2": 61.0, "c1": 0.2, "c2": 0.9, "c3": 0.1, "J2": 0.006, "J3": 0.02, "H3": 0.03}


def recording(truth: rig.Truth, rows=slice(None), **columns) -> Recording:
    """What perfect sensors record, and `columns` instead of some of it."""
    measured = {name: columns.get(name, truth.outputs[name])[rows] for name in rig.ALL}
    return Recording(Path("run.csv"), Motion(truth.time[rows], truth.theta[rows], truth.omega[rows]), measured, {})


@pytest.fixture(scope="module")
def truth():
    return rig.experiment(seed=4, duration=4)


def fixed(truth: rig.Truth, model) -> dict[str, float]:
    return {name: truth.parameters[name] for name in model.known.real}


@pytest.mark.parametrize("rows", [slice(None), slice(1234, 3235)], ids=["from rest", "in motion"])
def test_perfect_sensors_leave_nothing(model, truth, rows):
    """A recording that starts and ends anywhere is explained to one part in a million."""
    task = task_of(model.known, rig.NAMES, parameters=fixed(truth, model), offsets=False)
    fitter = Fitter(model, [prepare(recording(truth, rows))], task, dict.fromkeys(rig.ALL, 1.0))
    modelled = fitter.modelled(task.first())[0]
    for i, name in enumerate(rig.ALL):
        expected = truth.outputs[name][rows]
        assert np.abs(modelled[:, i] - expected).max() < 2e-5 * np.abs(expected).max(), name
        assert np.sqrt(np.mean((modelled[:, i] - expected) ** 2)) < 1e-6 * np.abs(expected).max(), name


def test_missing_and_uneven_rows_change_nothing(model, truth):
    keep = np.sort(np.random.default_rng(0).choice(len(truth.time), 3000, replace=False))
    slow = np.where(np.arange(len(truth.time)) % 10 == 0, truth.outputs["pitch"], np.nan)
    task = task_of(model.known, rig.NAMES, parameters=fixed(truth, model), offsets=False)
    for measured in (recording(truth, pitch=slow), recording(truth, keep)):
        fitter = Fitter(model, [prepare(measured)], task, dict.fromkeys(rig.ALL, 1.0))
        comparison, at = fitter.compare(task.first())[0], np.searchsorted(truth.time, measured.time)
        left, there = np.abs(comparison.residual).max(axis=(0, 1)), np.abs(comparison.experiment.measured).max(axis=0)
        assert (left < 2e-5 * there).all(), left / there
        modelled = fitter.modelled(task.first())[0]
        np.testing.assert_allclose(modelled[20:-20, 0], truth.outputs["tau1"][at][20:-20], atol=1e-2)


def test_derivatives_by_the_parameters(model, truth):
    """Those that the search uses, against differences, encoders' errors included."""
    columns = rig.measure(truth, 5, counts=2000)
    motion = Motion(truth.time, np.column_stack([columns["theta1"], columns["theta2"]]))
    measured = Recording(Path("run.csv"), motion, {name: columns[name] for name in rig.ALL}, {})
    task = task_of(model.known, rig.NAMES, parameters=fixed(truth, model))
    noise = {"tau1": 0.02, "tau2": 0.02, "theta3": 1e-3, "theta4": 1e-3, "pitch": 1e-3, "roll": 1e-3}
    fitter, at = Fitter(model, [prepare(measured)], task, noise), task.first()
    found = fitter.slopes(at)
    step = 1e-5
    for i, direction in enumerate(np.eye(len(at))):
        differences = (fitter.residuals(at + step * direction) - fitter.residuals(at - step * direction)) / (2 * step)
        # Kaufman's form leaves out a part that is perpendicular to the residual's motion and vanishes with it.
        assert np.linalg.norm(found[:, i] - differences) < 5e-3 * np.linalg.norm(differences), task.names[i]


def test_a_value_that_the_fmu_refuses(model):
    with pytest.raises(UserError, match="k1 must"):
        model.at({**model.known.starts, "k1": -1.0})


def test_the_model_forgets(model):
    first = model.at({})
    model.at(OTHER)
    again = model.at({})
    for block in ("A", "B", "C", "D"):
        np.testing.assert_array_equal(getattr(first, block), getattr(again, block))
