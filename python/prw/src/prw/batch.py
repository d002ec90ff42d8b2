"""A part of the runs of a sweep, for `prw.sweeps` in this process and for `prw.cluster` on the workers of a cluster."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import fmu_run

from prw.motion import Array, Motion
from prw.testbed import Testbed, driven_by, stopped


class Request(NamedTuple):
    """What all runs of a sweep have in common.

    Attributes
    ----------
    motion
        The motion of the motors.
    fixed
        Start values that are the same in all runs, by name.
    outputs, statistics
        Names of outputs and of their statistics.
    every
        Trajectories have every `every`-th sample; None if they are not kept.
    """

    motion: Motion
    fixed: Mapping[str, Any]
    outputs: tuple[str, ...]
    statistics: tuple[fmu_run.Measure, ...]
    every: int | None


class Part(NamedTuple):
    """Results of some runs.

    Attributes
    ----------
    measured
        Statistics (runs,) by the name of the column.
    errors
        Messages of failed runs by their index in the part.
    trajectories
        (runs, times) by output, and `time`, (times,) in s; empty if they are not kept.
    """

    measured: dict[str, Array]
    errors: dict[int, str]
    trajectories: dict[str, Array]


def run_part(
    testbed: Testbed,
    request: Request,
    values: Mapping[str, Array],
    threads: int,
    progress: Callable[[int, int], None] | None = None,
) -> Part:
    """Carry out the runs with these values of parameters, (runs,) by name."""
    driven = driven_by(request.motion, {**request.fixed, **values})
    chosen: dict[str, Any] = {"outputs": request.outputs, "measures": request.statistics, "every": request.every}
    runs = testbed.loaded.run(request.motion.time, **chosen, threads=threads, progress=progress, **driven)
    errors = {run: stopped(message) for run, message in runs.errors.items()}
    measured = {f"{name}_{which}": runs[name, which] for name in request.outputs for which in request.statistics}
    return Part(measured, errors, {"time": runs.time, **runs} if request.every else {})
