"""Parameter studies and Monte Carlo over thousands of runs of the testbed: `sweep`."""

from __future__ import annotations

import itertools
import math
import os
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from prw.arguments import Table, counted, spread_of
from prw.errors import UserError
from prw.extras import need
from prw.motion import Array, Motion
from prw.progress import Progress
from prw.recording import Recording
from prw.simulation import Run, motion_of
from prw.sweeps.study import Rows, Study, chunks, run_chunk
from prw.testbed import Testbed, existing_fmu

if TYPE_CHECKING:
    import pyarrow

#: A chunk is kept when it is done, and is the unit of what an interruption loses: so many in a study, of so many runs.
CHUNKS, LONGEST_CHUNK = 16, 256
MOST_RUNS = 10_000_000


class Swept(NamedTuple):
    """table: a row each run. runs: how many were made now, the others were there already. seconds: what they took."""

    table: pyarrow.Table
    runs: int
    seconds: float


def sweep(
    grid: Mapping[str, ArrayLike] | None = None,
    random: Mapping[str, float | tuple[float, float]] | None = None,
    *,
    runs: int = 1000,
    seed: int = 0,
    motion: Motion | Recording | Run | str | os.PathLike[str] | Table | None = None,
    threads: int | None = None,
    scheduler: str | None = None,
    fmu: str | os.PathLike[str] | None = None,
    out: str | os.PathLike[str] | None = None,
) -> pyarrow.Table:
    """Run the testbed with many sets of parameters.

    Parameters
    ----------
    grid
        Values by parameter, in SI; all combinations are run.
    random
        By parameter the relative standard deviation (0.1 is 10 %) about the start value, or (value, relative) about
        another one; `runs` log-normal draws for each combination of the grid, from the seed `seed`.
    motion
        As for `prw.simulate`; so is `fmu`.
    threads
        How many make the runs (default: one for each processor).
    scheduler
        The address of a Dask cluster that makes the runs instead.
    out
        A folder in which what is done is kept, so that the same call goes on after an interruption, and the table
        in the end.

    Returns
    -------
    pyarrow.Table
        An Arrow table (`.to_pandas()` makes a DataFrame of it), a row each run: `run`; `status`, "done" or
        "failed"; `message`, why it failed, as where the FMU refuses a value; the parameters; and of each output the
        peak (of its magnitude), rms and value at the end, such as `roll_peak`, in SI.

    Raises
    ------
    UserError
        An argument makes no sense, a file cannot be read or written, or the cluster does not answer.
    """
    need("pyarrow")
    if scheduler:
        need("distributed")
    path = existing_fmu(fmu)
    with Testbed(path) as testbed:
        values = layout(grid or {}, random or {}, runs, seed, testbed.starts)
        study = Study(path.read_bytes(), motion_of(motion), tuple(values), np.column_stack(list(values.values())))
        return carry_out(study, testbed, None if out is None else Path(out), threads, scheduler).table


def carry_out(study: Study, testbed: Testbed, out: Path | None, threads: int | None, scheduler: str | None) -> Swept:
    """Make the runs of the study that are missing in the folder `out`, here with `testbed`; the rest as for `sweep`."""
    from prw.sweeps.store import Memory, Store

    threads = counted("threads", threads) if threads is not None else os.cpu_count() or 1
    store = Memory(study) if out is None else Store(out, study)
    total, done = len(study.table), store.done()
    missing = [number for number in range(total) if number not in done]
    start, finished = time.monotonic(), len(done)
    if missing:
        parts = chunks(missing, max(threads, min(LONGEST_CHUNK, -(-len(missing) // CHUNKS))))
        results: Iterable[Rows] = (run_chunk(study, testbed, part, threads) for part in parts)
        if scheduler:
            from prw.sweeps.cluster import on_cluster

            results = on_cluster(study, parts, scheduler)
        with Progress(f"{total} runs", total) as progress:
            for rows in results:
                store.add(rows)
                finished += len(rows)
                progress(finished)
    return Swept(store.finish(), len(missing), time.monotonic() - start)


def layout(
    grid: Mapping[str, ArrayLike],
    random: Mapping[str, float | tuple[float, float]],
    runs: int,
    seed: int,
    starts: Mapping[str, float],
) -> dict[str, Array]:
    """The values of the parameters that vary, (runs,) each: all combinations of the grid, each with all draws.
    starts: the FMU's start values. Raises UserError for what does not fit."""
    for name in (*grid, *random):
        if name not in starts:
            argument = "grid" if name in grid else "random"
            raise UserError(f"{argument}: {name} is not known; there are {', '.join(starts)}")
        if name in grid and name in random:
            raise UserError(f"{name} is in the grid and random; choose one")
    if not grid and not random:
        raise UserError("nothing varies; give values by parameter (grid), or relative standard deviations (random)")
    draws = counted("runs", runs) if random else 1
    axes = {name: _column(name, values) for name, values in grid.items()}
    total = math.prod(map(len, axes.values())) * draws
    if total > MOST_RUNS:
        raise UserError(f"{total} runs are more than {MOST_RUNS}; take fewer steps or runs")
    combinations = np.array(list(itertools.product(*axes.values())), dtype=np.float64).reshape(
        total // draws, len(axes)
    )
    table = dict(zip(axes, np.repeat(combinations, draws, axis=0).T))
    generator = np.random.default_rng(seed)
    for name, spread in random.items():
        value, relative = spread_of(f"random: {name}", spread, starts[name])
        table[name] = value * np.exp(relative * generator.standard_normal(total))
    return table


def _column(name: str, values: Any) -> Array:
    try:
        column = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError):
        column = np.empty(0)
    # Values that the FMU refuses are runs that fail, not a reason to stop.
    if column.ndim != 1 or not len(column) or not np.isfinite(column).all():
        raise UserError(f"{name}: {values!r} are not the values of a parameter, one or more finite numbers")
    return column
