"""`prw excite`: motor motions to identify parameters with, ranked by what they tell."""

from __future__ import annotations

import argparse
from pathlib import Path

from prw.commands.options import DEFAULT_FMU, DEFAULT_OUT
from prw.identify.options import FORMATTER, add_task_options, names, need, number, numbers

DESCRIPTION = """\
Proposes motor motions within the motors' limits and ranks them by what they tell about the parameters: the standard
errors to be expected from measuring the given channels once, with unknown sensor offsets. Kinds: multisines (slow,
wide, and one whose spectrum is optimal for the parameters), chirps; with equal, opposite, single and independent
motors. Each motion becomes a CSV file for `prw simulate --input` or for your motor controller (s, rad, rad/s).
"""

EXAMPLES = """\
examples:
  prw excite                                        all channels, a 10 s experiment at 1 kHz
  prw excite --measure tau1,tau2                    what torque sensors alone can tell
  prw excite --angle 20 --speed 120 --acceleration 3000 --duration 30      your motors, in deg, deg/s, deg/s2
  prw excite --estimate J2,J3,H3                    motions for the inertias
"""


def add_parser(subparsers) -> None:
    """Add `excite` to prw's subcommands."""
    parser = subparsers.add_parser(
        "excite",
        help="propose motor motions to identify parameters with",
        description=DESCRIPTION,
        epilog=EXAMPLES,
        formatter_class=FORMATTER,
    )
    parser.add_argument(
        "--measure", default="all", metavar="NAMES", help="channels that will be measured (default: all)"
    )
    parser.add_argument(
        "--angle", type=float, default=40.0, metavar="DEG", help="motor limit, deg (default: %(default)g)"
    )
    parser.add_argument(
        "--speed", type=float, default=450.0, metavar="DEG/S", help="motor limit, deg/s (default: %(default)g)"
    )
    parser.add_argument(
        "--acceleration",
        type=float,
        default=20000.0,
        metavar="DEG/S2",
        help="motor limit, deg/s2 (default: %(default)g)",
    )
    parser.add_argument("--duration", type=float, default=10.0, metavar="S", help="of a motion (default: %(default)g)")
    parser.add_argument("--rate", type=float, default=1000.0, metavar="HZ", help="of sampling (default: %(default)g)")
    add_task_options(parser)
    parser.add_argument("--fmu", type=Path, default=DEFAULT_FMU, help="the testbed FMU (default: %(default)s)")
    parser.add_argument(
        "--out",
        type=Path,
        default=DEFAULT_OUT / "excite",
        metavar="DIR",
        help="where the motions and ranking.json go (default: %(default)s)",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Carry out `prw excite`. Raises UserError with one line on what is wrong."""
    need("scipy", "jinja2", "threadpoolctl")
    import numpy as np
    from threadpoolctl import threadpool_limits

    from prw.channels import MEASURED
    from prw.errors import UserError
    from prw.identify import design
    from prw.identify.command import task_of
    from prw.identify.exports import write_json
    from prw.identify.model import Model
    from prw.identify.statistics import covariance_of, undetermined
    from prw.output import write_motion

    angle, speed, acceleration, duration, rate = (
        number(str(getattr(arguments, name)), f"--{name}")
        for name in ("angle", "speed", "acceleration", "duration", "rate")
    )
    if duration < 4 * design.FADE or duration * rate > 2e6:
        raise UserError(
            f"--duration {duration:g}: it must be {4 * design.FADE:g} s or more, and at most 2 million samples"
        )
    if rate < 50:
        raise UserError(f"--rate {rate:g}: the testbed moves at up to 30 Hz; sample with 50 Hz or more")
    channels = tuple(MEASURED) if arguments.measure == "all" else names(arguments.measure, list(MEASURED), "--measure")
    noise = {**design.default_noise(), **numbers(arguments.noise, list(MEASURED), "--noise")}
    noise = {name: noise[name] for name in channels}
    limits = design.Limits(*np.deg2rad([angle, speed, acceleration]))
    ranking = []
    with Model(arguments.fmu) as model, threadpool_limits(1):
        task = task_of(arguments, model)
        point = np.log([task.start[name] for name in task.names])
        for motion in design.motions(model, task, limits, duration, rate, noise):
            told = design.information(model, [design.plan(motion, channels)], task, point, noise)
            errors = np.sqrt(np.diag(covariance_of(told)))
            ranking.append((design.typical_error(told), motion, errors, undetermined(task.names, told)))
    # Where a combination stays open in all of them, what is known of the others decides.
    ranking.sort(key=lambda entry: (entry[0], float(np.log(entry[2]).mean())))
    for _, motion, _, _ in ranking:
        write_motion(arguments.out / f"{motion.name}.csv", motion)
    write_json(
        arguments.out / "ranking.json",
        {
            "measured": {name: noise[name] for name in channels},
            "duration": duration,
            "rate": rate,
            "motions": [
                {
                    "file": f"{motion.name}.csv",
                    "typical_error": typical if np.isfinite(typical) else None,
                    "expected_errors": {name: min(float(e), 1e6) for name, e in zip(task.names, errors)},
                    "undetermined": [str(combination) for combination in left],
                }
                for typical, motion, errors, left in ranking
            ],
        },
    )
    print(
        f"expected standard errors of one experiment of {duration:g} s at {rate:g} Hz, measuring {', '.join(channels)}"
    )
    print(f"  {'motion':<28}{'typical':>9}" + "".join(f"{name:>9}" for name in task.names))
    for typical, motion, errors, _ in ranking:
        print(f"  {motion.name:<28}{_percent(typical):>9}" + "".join(f"{_percent(e):>9}" for e in errors))
    best = ranking[0]
    for combination in best[3]:
        print(f"note        even the best: {combination}")
    print(f"wrote       {len(ranking)} motions and ranking.json into {arguments.out}")
    print(f"next        look at the best: prw simulate --input {arguments.out / best[1].name}.csv")


def _percent(value: float) -> str:
    return f"{value:.3%}" if value < 0.1 else f"{value:.1%}" if value < 10 else "none"
