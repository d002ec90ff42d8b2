"""Clocks from Python. The Rust tests of fmu-run check the ticks."""

from __future__ import annotations

import warnings

import fmu_run
import numpy as np
import pytest
from c_models import pack


@pytest.fixture(scope="module")
def clocks(tmp_path_factory):
    with fmu_run.Fmu(pack(tmp_path_factory.mktemp("clocks") / "clocks.fmu", "clocks", "clocks3")) as fmu:
        yield fmu


@pytest.mark.parametrize("interface", ["co-simulation", "model-exchange"])
def test_ticks(clocks, interface):
    time = np.arange(5) * 0.1
    given = {
        "inputs": {"u": 1.0, "sample": [1.0, 2.0, 3.0, 4.0, 5.0]},
        "outputs": ["sum", "presses", "x"],
        "clocks": {"pressed": [0.1, 0.25]},
        "interface": interface,
    }
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runs = clocks.run(time, **given, events=True).check()
        np.testing.assert_allclose(runs["sum"], [[1, np.nan, 4, np.nan, 9]])
        np.testing.assert_allclose(runs["presses"], [[np.nan, 1, np.nan, np.nan, np.nan]])
        held = clocks.run(time, **given, hold=True).check()
        np.testing.assert_allclose(held["sum"], [[1, 1, 4, 4, 9]])
        np.testing.assert_allclose(held["presses"], [[np.nan, 1, 1, 2, 2]])
    ticks = [(round(event.time, 9), event.clocks) for event in runs.events if event.clocks]
    assert ticks == [(0, ["tick"]), (0.1, ["pressed"]), (0.2, ["tick"]), (0.25, ["pressed"]), (0.4, ["tick"])]
    pressed = runs.events[3]
    assert pressed.after["presses"] == 2 and pressed.after["x"] == pytest.approx(0.25)
    assert np.isnan(pressed.before["presses"]) and np.isnan(pressed.after["sum"])


def test_arguments(clocks):
    for given, why in [
        ({"tick": [0.1]}, "tick is not a triggered input clock"),
        ({"pressed": [[0.1]]}, "pressed must have one dimension, it has 2"),
        ({"pressed": 0.1}, "pressed must have one dimension, it has 0"),
        ([0.1], "clocks must be a dict of values by name"),
    ]:
        with pytest.raises(ValueError, match=why):
            clocks.run([0.0, 1.0], outputs=["x"], clocks=given)
    assert not any(name in clocks.variables for name in ["tick", "sum"])
