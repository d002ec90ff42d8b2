"""Statistics of many runs of the testbed, for `prw.sweeps` in this process and for `prw.cluster` on the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import fmu_run

from prw.motion import Array, Motion
from prw.testbed import OUTPUTS, Testbed, driven_by, stopped

#: The statistics of each output in a result.
MEASURES: tuple[fmu_run.Measure, ...] = ("peak", "rms", "end")
#: Statistics by the name of the column, each an array with one value per run; and the messages of failed runs, by run.
Statistics = tuple[dict[str, Array], dict[int, str]]


def statistics(
    testbed: Testbed,
    motion: Motion,
    start: Mapping[str, Any],
    threads: int,
    progress: Callable[[int, int], None] | None = None,
) -> Statistics:
    """The statistics of runs with the start values `start`: for each name one value for all runs, or an array with one
    value per run."""
    runs = testbed.loaded.run(
        motion.time, outputs=OUTPUTS, measures=MEASURES, threads=threads, progress=progress, **driven_by(motion, start)
    )
    errors = {run: stopped(message) for run, message in runs.errors.items()}
    return {f"{name}_{measure}": runs[name, measure] for name in OUTPUTS for measure in MEASURES}, errors
