"""`prw sweep`: parameter studies and Monte Carlo over thousands of runs of the FMU."""

from __future__ import annotations

import argparse
from pathlib import Path

from prw.identify.options import FORMATTER, need
from prw.simulate import DEFAULT_FMU, DEFAULT_OUT

DESCRIPTION = """\
Runs the FMU over and over with other parameters, on all cores of this machine or on a Dask cluster, and writes one row
for each run into runs.parquet: its parameters and each output's peak, rms and value at the end (SI).

--grid parameters make all combinations; --random ones are drawn for each of --runs runs (per combination). What is
done is kept: the same command goes on after an interruption. A run that fails is recorded with its message.
"""

EXAMPLES = """\
examples:
  prw sweep --grid k1=60:240:13 --grid c3=0.1:0.8:8           104 combinations, in the experiment of Fig. 4
  prw sweep --random k1=10% --random k2=10% --runs 5000       Monte Carlo, 10 % (one sigma) about the start values
  prw sweep --random J3=5% --runs 2000 --input motors.csv     in your recorded motion
  prw sweep --random k1=10% --runs 100000 --scheduler tcp://head:8786      on a Dask cluster (prw installed there)
then:
  python -c "import pyarrow.parquet as pq; print(pq.read_table('out/sweep/runs.parquet').column_names)"
"""


def add_parser(subparsers) -> None:
    """Add `sweep` to prw's subcommands."""
    parser = subparsers.add_parser(
        "sweep",
        help="run the FMU with many sets of parameters",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=FORMATTER,
    )
    parser.add_argument(
        "--grid", action="append", default=[], metavar="NAME=LOW:HIGH:N", help="N even steps, in SI. May be repeated"
    )
    parser.add_argument(
        "--random",
        action="append",
        default=[],
        metavar="NAME=[VALUE:]PERCENT%",
        help="log-normal about VALUE in SI (default: the start value). May be repeated",
    )
    parser.add_argument("--runs", type=int, default=1000, metavar="N", help="draws of --random (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draws (default: %(default)s)")
    parser.add_argument(
        "--input", type=Path, metavar="FILE", help="motor recording, as for `prw simulate` (default: that of Fig. 4)"
    )
    parser.add_argument("--degrees", action="store_true", help="the recording is in degrees and degrees per second")
    parser.add_argument("--workers", type=int, metavar="N", help="processes on this machine (default: one per core)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of a Dask cluster, like tcp://head:8786")
    parser.add_argument("--fmu", type=Path, default=DEFAULT_FMU, help="the testbed FMU (default: %(default)s)")
    parser.add_argument(
        "--out", type=Path, default=DEFAULT_OUT / "sweep", metavar="DIR", help="where to write (default: %(default)s)"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Carry out `prw sweep`. Raises UserError with one line on what is wrong."""
    need("pyarrow", *(["distributed"] if arguments.scheduler else []))
    from prw.sweep.command import sweep

    sweep(arguments)
