"""Proposes motor motions within the motors' limits. Ranks them by the parameters' standard errors that are expected if the
given channels are measured once and the sensors have unknown offsets. The assumed noise is white, with standard
deviations of 0.02 N.m (torques), 0.001 rad (angles) and 0.01 rad/s (rates); --noise sets others. "typical" is the root
mean square of a row. The motions are slow multisines, wide multisines and chirps, each with equal, opposite, single and
independent motors, and one multisine whose spectrum is optimal for the parameters. Each motion is written as a CSV file
(s, rad, rad/s) for `prw simulate` or for your motor controller.
"""

from __future__ import annotations

import argparse
import json

import numpy as np

from prw.arguments import positive
from prw.commands.options import add_paths, add_task_options, call, decimal, listed, show
from prw.errors import need
from prw.files import write_table, write_text
from prw.identification.excitation import excite

HELP = "propose motor motions to identify parameters with"
EXAMPLES = """\
examples:
  prw excite                                        all channels, a 10 s experiment at 1 kHz
  prw excite --measure tau1,tau2                    with torque sensors only
  prw excite --angle 20 --speed 120 --acceleration 3000 --duration 30      your motors, in deg, deg/s, deg/s2
  prw excite --estimate J2,J3,H3                    motions for the inertias
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--measure", type=listed, default="all", metavar="NAMES", help="channels that will be measured (default: all)"
    )
    for name, default, unit, meaning in (
        ("angle", 40.0, "DEG", "limit of the motors' angles"),
        ("speed", 450.0, "DEG/S", "limit of the motors' rates"),
        ("acceleration", 20000.0, "DEG/S2", "limit of the motors' accelerations"),
        ("duration", 10.0, "S", "duration of a motion"),
        ("rate", 1000.0, "HZ", "samples per second"),
    ):
        about = f"{meaning} (default: %(default)g)"
        parser.add_argument(f"--{name}", type=decimal, default=default, metavar=unit, help=about)
    add_task_options(parser)
    add_paths(parser, "directory of the motions and ranking.json", "excite")


def run(arguments: argparse.Namespace) -> None:
    """Carry out `prw excite`. Raises UserError with a message of one line."""
    need("scipy", "threadpoolctl")
    names = ("angle", "speed", "acceleration")
    limits = {name: np.deg2rad(positive(name, getattr(arguments, name))) for name in names}
    ranking = call(excite, arguments, **limits, measure=None if arguments.measure == ("all",) else arguments.measure)
    for entry in ranking:
        write_table(arguments.out / f"{entry.name}.csv", entry.motion.columns)
    best = ranking[0]
    content = {
        "measured": dict(best.noise),
        "duration": arguments.duration,
        "rate": arguments.rate,
        "motions": [
            {
                "file": f"{entry.name}.csv",
                "typical_error": entry.typical_error if np.isfinite(entry.typical_error) else None,
                "expected_errors": {name: min(error, 1e6) for name, error in entry.expected_errors.items()},
                "undetermined": entry.undetermined,
            }
            for entry in ranking
        ],
    }
    write_text(arguments.out / "ranking.json", json.dumps(content, indent=2, allow_nan=False) + "\n")
    measured = ", ".join(best.noise)
    show(
        f"expected standard errors of one experiment of {arguments.duration:g} s at {arguments.rate:g} Hz, measuring {measured}"
    )
    show(f"  {'motion':<28}{'typical':>9}" + "".join(f"{name:>9}" for name in best.expected_errors))
    for entry in ranking:
        errors = (entry.typical_error, *entry.expected_errors.values())
        show(f"  {entry.name:<28}" + "".join(f"{_percent(error):>9}" for error in errors))
    for combination in best.undetermined:
        show(f"note        even the best: {combination}")
    show(f"wrote       {len(ranking)} motions and ranking.json into {arguments.out}")
    show(f"next        look at the best: prw simulate {arguments.out / best.name}.csv")


def _percent(value: float) -> str:
    return f"{value:.3%}" if value < 0.1 else f"{value:.1%}" if value < 10 else "none"
