"""Parameter studies and Monte Carlo over thousands of runs of the testbed: `sweep`."""

from __future__ import annotations

import contextlib
import itertools
import math
import os
import warnings
from collections.abc import Mapping
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from prw.arguments import Given, Table, check_names, counted, in_own_unit, spread_of, values_of
from prw.batch import statistics
from prw.errors import UserError, need
from prw.files import replacing
from prw.motion import Array, Motion
from prw.progress import Progress
from prw.recording import Recording
from prw.simulation import Run, motion_of
from prw.testbed import Testbed, existing_fmu

if TYPE_CHECKING:
    import pyarrow

MAX_RUNS = 10_000_000
#: The distribution of a parameter, see `sweep`.
Spread = float | tuple[float, float] | tuple[str, float, float]


def sweep(
    grid: Mapping[str, ArrayLike] | None = None,
    random: Mapping[str, Spread] | None = None,
    *,
    parameters: Given = None,
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
        Values by parameter, in SI or with a unit as ([1.5, 1.9], "N.m/deg"); all combinations are run.
    random
        The distribution of each parameter, in SI: ("uniform", low, high), ("normal", mean, standard deviation) or
        ("lognormal", median, relative standard deviation). For a lognormal distribution, (median, relative) suffices,
        or only the relative standard deviation (0.1 is 10 %) if the median is the start value.
    parameters
        Values that are the same in all runs, as for `prw.simulate`.
    runs, seed
        Number of random draws for each combination of the grid, and their seed.
    motion, fmu
        As for `prw.simulate`.
    threads
        Number of threads (default: one for each processor).
    scheduler
        The address of the scheduler of a Dask cluster. The simulations then run on the cluster instead of in this process.
    out
        A directory, in which the table is written as runs.parquet.

    Returns
    -------
    pyarrow.Table
        An Arrow table with a row for each run; its method to_pandas makes a DataFrame. The columns are `run`; `status`,
        "done" or "failed"; `message`, the cause of a failure, for example that the FMU rejects a value; and the parameters
        in `grid` and `random`. Three more columns for each output have its statistics in SI. For the roll these are
        `roll_peak`, the peak of its magnitude; `roll_rms`; and `roll_end`, its value at the end.

    Raises
    ------
    UserError
        An argument is out of range, a file cannot be read or written, or the cluster does not respond.

    Warns
    -----
    RuntimeWarning
        All runs failed.
    """
    need("pyarrow", *(["distributed"] if scheduler else []))
    threads = counted("threads", threads) if threads is not None else os.cpu_count() or 1
    with Testbed(existing_fmu(fmu)) as testbed, contextlib.ExitStack() as stack:
        fixed = values_of(parameters, testbed.loaded)
        values, moved = layout(grid or {}, random or {}, runs, seed, testbed, fixed), motion_of(motion)
        # The file is created first, so that a directory that cannot be written costs no runs.
        temporary = None if out is None else stack.enter_context(replacing(Path(out) / "runs.parquet"))
        table = _run_all(testbed, moved, values, fixed, threads, scheduler)
        if temporary is not None:
            import pyarrow.parquet

            pyarrow.parquet.write_table(table, temporary)
    if "done" not in table["status"].to_pylist():
        warnings.warn(f"all {table.num_rows} runs failed; run 0: {table['message'][0]}", RuntimeWarning, stacklevel=2)
    return table


def _run_all(
    testbed: Testbed,
    motion: Motion,
    values: Mapping[str, Array],
    fixed: Mapping[str, Any],
    threads: int,
    scheduler: str | None,
) -> pyarrow.Table:
    """Carry out all runs and return their table. `values` has an array for each parameter that varies, with one value per
    run; `fixed` has the values that are the same in all runs."""
    import pyarrow as pa

    start, total = {**fixed, **values}, len(next(iter(values.values())))
    with Progress(f"{total} runs", total) as progress:
        if scheduler:
            from prw.cluster import on_cluster

            measured, errors = on_cluster(testbed.fmu, motion, fixed, values, scheduler, progress)
        else:
            measured, errors = statistics(testbed, motion, start, threads, lambda done, _: progress(done))
    failed = np.isin(np.arange(total), list(errors))
    columns = {
        "run": pa.array(range(total), pa.int64()),
        "status": np.where(failed, "failed", "done").tolist(),
        "message": [errors.get(run, "") for run in range(total)],
        **values,
        **{name: pa.array(column, mask=failed) for name, column in measured.items()},
    }
    return pa.table(columns)


def layout(
    grid: Mapping[str, ArrayLike],
    random: Mapping[str, Spread],
    runs: int,
    seed: int,
    testbed: Testbed,
    fixed: Mapping[str, Any],
) -> dict[str, Array]:
    """The values of each parameter that varies, one value per run: all combinations of the grid, each with its own draws. If
    only a relative standard deviation is given, the median is the value in `fixed` or the FMU's start value. Raises UserError for
    invalid arguments."""
    testbed.with_starts(fixed)
    starts = {**testbed.starts, **fixed}
    check_names("grid", grid, testbed.starts)
    check_names("random", random, testbed.starts)
    for name in (*grid, *random):
        if (name in grid) + (name in random) + (name in fixed and name in grid) > 1:
            raise UserError(f"{name} is in more than one of grid, random and parameters; choose one")
    if not grid and not random:
        raise UserError("nothing varies; give values of a parameter (grid) or its distribution (random)")
    draws = counted("runs", runs) if random else 1
    axes = {name: _column(name, in_own_unit(name, values, testbed.loaded)) for name, values in grid.items()}
    total = math.prod(map(len, axes.values())) * draws
    if total > MAX_RUNS:
        raise UserError(f"{total} runs are more than the limit of {MAX_RUNS}; give fewer values (grid) or draws (runs)")
    combinations = np.array(list(itertools.product(*axes.values())), dtype=np.float64).reshape(
        total // draws, len(axes)
    )
    table = dict(zip(axes, np.repeat(combinations, draws, axis=0).T))
    generator = np.random.default_rng(seed)
    for name, spread in random.items():
        table[name] = drawn(name, spread, starts[name], generator, total)
    return table


def drawn(name: str, spread: Spread, start: float, generator: np.random.Generator, count: int) -> Array:
    """Draw values (count,) from a distribution, see `sweep`. Raises UserError for an invalid distribution."""
    kind, *numbers = spread if isinstance(spread, tuple) and isinstance(spread[0], str) else ("lognormal", spread)
    if kind == "lognormal":
        median, relative = spread_of("random", name, tuple(numbers) if len(numbers) > 1 else numbers[0], start)
        return median * np.exp(relative * generator.standard_normal(count))
    finite = len(numbers) == 2 and all(isinstance(n, Real) and math.isfinite(float(n)) for n in numbers)
    one, other = map(float, numbers) if finite else (math.nan, math.nan)  # type: ignore[arg-type]
    if kind == "uniform" and one < other:
        return generator.uniform(one, other, count)
    if kind == "normal" and other > 0:
        return generator.normal(one, other, count)
    raise UserError(
        f'{name} {spread!r}: write ("uniform", low, high), ("normal", mean, deviation) or ("lognormal", median, relative)',
        argument="random",
    )


def _column(name: str, values: Any) -> Array:
    try:
        column = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError):
        column = np.empty(0)
    # The range is not checked here: if the FMU rejects a value, only the runs with this value fail.
    if column.ndim != 1 or not len(column) or not np.isfinite(column).all():
        raise UserError(f"{name} must have one or more finite numbers as values, not {values!r}")
    return column
