"""What `prw sweep` does: lay out the runs, make those that are missing, put the results together."""

from __future__ import annotations

import argparse
import itertools
import os
import time
from typing import Dict, List

import numpy as np

from prw import motion as motions
from prw import recording
from prw.errors import UserError
from prw.identify import options
from prw.progress import Progress
from prw.sweep.store import Store
from prw.sweep.study import Study, chunks
from prw.sweep.workers import on_cluster, on_this_machine
from prw.testbed import Testbed

#: A chunk is kept when it is done, and is the unit of what an interruption loses.
LONGEST_CHUNK = 256
#: So many chunks for each worker, so that all finish about at the same time.
CHUNKS_PER_WORKER = 8
MOST_RUNS = 10_000_000


def sweep(arguments: argparse.Namespace) -> None:
    """Carry out `prw sweep`. Raises UserError with one line on what is wrong."""
    if arguments.input is None:
        motion = motions.fig4()
    else:
        motion = recording.read(arguments.input, degrees=arguments.degrees)
    workers = arguments.workers if arguments.workers is not None else os.cpu_count() or 1
    if workers < 1:
        raise UserError(f"--workers {workers}: at least 1 is needed")
    with Testbed(arguments.fmu) as testbed:
        values = layout(arguments, testbed.starts)
    study = Study(arguments.fmu.read_bytes(), motion, tuple(values), np.column_stack(list(values.values())))
    store = Store(arguments.out, study)
    total = len(study.table)
    done = store.done()
    missing = [number for number in range(total) if number not in done]
    size = max(1, min(LONGEST_CHUNK, -(-len(missing) // (workers * CHUNKS_PER_WORKER))))
    parts = chunks(missing, size)
    start = time.monotonic()
    if parts:
        if arguments.scheduler:
            results = on_cluster(study, parts, arguments.scheduler)
        else:
            results = on_this_machine(study, parts, min(workers, len(parts)))
        finished = len(done)
        with Progress(f"{total} runs", total) as progress:
            for rows in results:
                store.add(rows)
                finished += len(rows)
                progress(finished)
    seconds = time.monotonic() - start
    counts = store.finish()
    where = arguments.scheduler or f"{workers} process{'es' if workers > 1 else ''}"
    if missing:
        again = f", {len(done)} were there already" if done else ""
        pace = f"{seconds:.1f} s ({len(missing) / seconds:.0f} a second)"
        print(f"ran         {len(missing)} runs on {where} in {pace}{again}")
    else:
        print(f"ran         nothing: all {total} runs were there already")
    if counts.get("failed"):
        print(f"failed      {counts['failed']} runs; {store.first_failure()}")
    print(f"wrote       {store.table}")


def layout(arguments: argparse.Namespace, starts: Dict[str, float]) -> Dict[str, np.ndarray]:
    """The values of the parameters that vary, (runs,) each: all combinations of the grids, each with all draws."""
    grids = {name: _steps(name, text, starts) for name, text in options.pairs(arguments.grid, "--grid").items()}
    spreads = options.spreads(arguments.random, starts, "--random")
    for name in spreads:
        if name in grids:
            raise UserError(f"{name} is in --grid and in --random; choose one")
    if not grids and not spreads:
        raise UserError("nothing varies; add --grid NAME=LOW:HIGH:N or --random NAME=PERCENT% (see --help)")
    draws = arguments.runs if spreads else 1
    if draws < 1:
        raise UserError(f"--runs {draws}: at least 1 is needed")
    combinations: List[tuple] = list(itertools.product(*grids.values()))
    total = len(combinations) * draws
    if total > MOST_RUNS:
        raise UserError(f"{total} runs are more than {MOST_RUNS}; take fewer steps or --runs")
    table = {name: np.repeat([c[i] for c in combinations], draws) for i, name in enumerate(grids)}
    random = np.random.default_rng(arguments.seed)
    for name, (value, relative) in spreads.items():
        table[name] = value * np.exp(relative * random.standard_normal(total))
    return {name: np.asarray(column, dtype=float) for name, column in table.items()}


def _steps(name: str, text: str, starts: Dict[str, float]) -> np.ndarray:
    options.names(name, list(starts), "--grid")
    parts = text.split(":")
    try:
        low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
        if len(parts) != 3 or count < 1 or not np.isfinite([low, high]).all():
            raise ValueError
    except (ValueError, IndexError):
        raise UserError(f"--grid {name}={text}: write {name}=LOW:HIGH:N with a whole number N of at least 1") from None
    # Values that the FMU refuses are runs that fail, not a reason to stop.
    return np.linspace(low, high, count)
