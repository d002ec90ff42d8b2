"""Runs the FMU many times with different parameters, on all cores of this machine or on a Dask cluster. Writes one row for
each run into runs.parquet: the run's parameters, and statistics of each output (SI).

The values of --grid are run in all combinations. For each combination, the parameters of --random are drawn --runs times.
A run that fails is recorded with its message. If the command is interrupted, the same command continues it.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path

import numpy as np

from prw.commands.options import DEFAULT_OUT, FMU, Named, add_unit_options, call, decimal, integer, listed, show, spread
from prw.draws import SAMPLINGS
from prw.errors import UserError, need
from prw.motion import Array, fig4
from prw.parts import TABLE, TRAJECTORIES
from prw.recording import read_motion
from prw.sweeps import DRAWS, STATISTICS, repeated, sweep

OUT, OUT_AGAIN = DEFAULT_OUT / "sweep", DEFAULT_OUT / "sweep-again"
HELP = "run the FMU with many sets of parameters"
EXAMPLES = """\
examples:
  prw sweep --grid k1=60:240:13 --grid c3=0.1:0.8:8           104 combinations, in the experiment of Fig. 4
  prw sweep --random k1=10% --random k2=10% --runs 5000       Monte Carlo, 10 % (one sigma) about the start values
  prw sweep --identified out/identified/report.json --sampling sobol --runs 1024     correlated, as identified
  prw sweep --random J3=5% --runs 2000 --input motors.csv     in your recorded motion
  prw sweep --random k1=10% --outputs roll --trajectories 10  with every tenth sample of the roll of each run
  prw sweep --random k1=10% --runs 100000 --scheduler tcp://head:8786      on a Dask cluster (prw installed there)
  prw sweep --again old/runs.parquet --out new                repeat a sweep from its file
then:
  python -c "import pyarrow.parquet as pq; print(pq.read_table('out/sweep/runs.parquet').column_names)"
"""


def _steps(string: str) -> Array:
    """N even values from LOW to HIGH. Raises ValueError."""
    parts = string.split(":")
    try:
        low, high, count = decimal(parts[0]), decimal(parts[1]), integer(parts[2])
        if len(parts) != 3 or count < 1 + (low != high) or not np.isfinite([low, high]).all():
            raise ValueError
    except (ValueError, IndexError):
        raise ValueError("write NAME=LOW:HIGH:N, with an integer N of at least 2, or NAME=VALUE:VALUE:1") from None
    return np.linspace(low, high, count)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--grid",
        action=Named,
        read=_steps,
        metavar="NAME=LOW:HIGH:N",
        help="N even values, the first is LOW and the last HIGH, in SI. May be repeated",
    )
    parser.add_argument(
        "--random",
        action=Named,
        read=spread,
        metavar="NAME=[VALUE:]PERCENT%",
        help="log-normal about VALUE in SI (default: the start value). May be repeated",
    )
    parser.add_argument(
        "--runs",
        type=integer,
        metavar="N",
        help=f"draws of --random or --identified for each combination of --grid (default: {DRAWS['runs']})",
    )
    parser.add_argument(
        "--identified",
        type=Path,
        metavar="FILE",
        help="report.json of `prw identify`; draws its estimates with their correlation, instead of --random",
    )
    parser.add_argument(
        "--table",
        type=Path,
        metavar="FILE",
        help="CSV or Parquet file with the parameters of each run in SI, as columns",
    )
    parser.add_argument(
        "--again", type=Path, metavar="FILE", help="a runs.parquet whose sweep is repeated, and compared with it"
    )
    parser.add_argument("--seed", type=integer, help=f"of the draws (default: {DRAWS['seed']})")
    parser.add_argument(
        "--sampling",
        choices=SAMPLINGS,
        help=f"Latin hypercube or Sobol points cover the distribution more evenly (default: {DRAWS['sampling']})",
    )
    parser.add_argument("--outputs", type=listed, metavar="NAMES", help="separated by commas (default: all)")
    parser.add_argument(
        "--statistics",
        type=listed,
        metavar="NAMES",
        help=f"of each output: min, max, peak, time_of_peak, mean, rms, end (default: {','.join(STATISTICS)})",
    )
    parser.add_argument(
        "--trajectories",
        type=integer,
        metavar="N",
        help="also write every Nth sample of the outputs into the directory trajectories",
    )
    parser.add_argument(
        "--input",
        type=Path,
        metavar="FILE",
        help="motor recording, as for `prw simulate` (default: the motion of Fig. 4)",
    )
    add_unit_options(parser, "the recording is")
    parser.add_argument("--threads", type=integer, metavar="N", help="on this machine (default: one per core)")
    parser.add_argument("--workers", type=integer, dest="threads", help=argparse.SUPPRESS)  # its name in 0.2.0
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster, like tcp://head:8786")
    parser.add_argument("--fmu", type=Path, help=FMU)
    parser.add_argument(
        "--out", type=Path, metavar="DIR", help=f"directory to write into (default: {OUT}, with --again {OUT_AGAIN})"
    )


def _runs(count: int, kind: str = "") -> str:
    return f"{count} {kind}run{'s' * (count != 1)}"


def run(arguments: argparse.Namespace) -> None:
    """Carry out `prw sweep`. Raises UserError with a message of one line."""
    if arguments.input is None and arguments.degrees is not None:
        raise UserError("--degrees and --radians belong to a recording (--input); the motion of Fig. 4 is in radians")
    motion = fig4() if arguments.input is None else read_motion(arguments.input, degrees=arguments.degrees)
    threads = arguments.threads if arguments.threads is not None else os.cpu_count() or 1
    arguments.options = {"motion": "--input"}
    if arguments.identified is not None:
        if arguments.random:
            raise UserError("replaces --random; choose one", argument="identified")
        arguments.options["random"] = "--identified"
    varied = (arguments.identified, arguments.table, arguments.again)
    if not (arguments.grid or arguments.random or any(path is not None for path in varied)):
        raise UserError("nothing varies; give --grid, --random, --identified or --table")
    need("pyarrow")
    if arguments.out is None:
        arguments.out = OUT if arguments.again is None else OUT_AGAIN
    finished: list[int] = []
    notes: list[str] = []
    begin = time.monotonic()
    table = call(
        sweep,
        arguments,
        notes,
        progress=lambda done, _: finished.append(done),
        motion=motion,
        grid=arguments.grid or None,
        random=arguments.identified or arguments.random or None,
    )
    earlier, seconds = finished[0], time.monotonic() - begin
    count = table.num_rows - earlier
    for note in notes:
        show(f"note        {note}")
    if earlier:
        show(f"kept        {_runs(earlier, 'finished ')} in {arguments.out}")
    where = arguments.scheduler or f"{threads} thread{'s' if threads > 1 else ''}"
    show(f"ran         {_runs(count)} on {where} in {seconds:.1f} s ({count / seconds:.0f} per second)")
    status = table.column("status").to_pylist()
    if failed := status.count("failed"):
        first = status.index("failed")
        show(f"failed      {_runs(failed)}; run {first}: {table.column('message')[first]}")
    if arguments.again is not None:
        unlike = repeated(arguments.again, table)
        verdict = f"other values in {', '.join(unlike)}" if unlike else "all values are equal"
        show(f"repeated    {arguments.again}: {verdict}")
    more = f", {arguments.out / TRAJECTORIES}" if (arguments.out / TRAJECTORIES).is_dir() else ""
    show(f"wrote       {arguments.out / TABLE}{more}")
