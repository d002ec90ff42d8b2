"""Errors, notes and results of runs that end early, as Python returns them. The Rust tests of fmu-run test each way in which a run can end."""

from __future__ import annotations

import fmu_run
import numpy as np

TIME = np.arange(11) / 10


def test_runs_that_end_early(faulty_fmu):
    # A good run, a failed step, an end by the FMU, an error after the end, and a run that never starts.
    arguments = {"start": {"behaviour": [0, 4, 8, 10, 11]}, "outputs": ["y"]}
    with fmu_run.Fmu(faulty_fmu) as fmu:
        runs = fmu.run(TIME, every=1, measures=["end"], **arguments)
        thinned = fmu.run(TIME, every=2, **arguments)
    assert (
        runs.errors
        == thinned.errors
        == {
            1: "at 0.5 s: fmi2DoStep: no more of this after half",
            2: "ended by the FMU at t = 0.525 s: the tank is empty",
            4: "fmi2ExitInitializationMode returned Error without a message",
        }
    )
    assert runs.notes == thinned.notes == {3: "finished; then fmi2Terminate returned Error without a message"}
    assert runs.ok.tolist() == [True, False, False, True, False]
    y = [np.where(np.arange(11) < count, 4.0 + TIME, np.nan) for count in (11, 6, 6, 11, 0)]
    np.testing.assert_allclose(runs["y"], y, rtol=1e-15)
    np.testing.assert_allclose(thinned["y"], [row[::2] for row in y], rtol=1e-15)
    np.testing.assert_allclose(runs["y", "end"], [5.0, np.nan, 4.5, 5.0, np.nan], rtol=1e-15)
