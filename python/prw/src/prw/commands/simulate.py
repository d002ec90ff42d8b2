"""Simulates the paper's experiment (Fig. 4) or the response to recorded motor angles. Writes a CSV table (time, inputs,
all outputs; s, rad, rad/s, N.m) and, with the extra prw[plot], a PNG figure."""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from prw.animation import animate, suffix_of
from prw.columns import QUANTITIES, si_unit
from prw.commands.options import (
    add_parameter_options,
    add_paths,
    add_reading_options,
    call,
    parameters_of,
    show,
)
from prw.errors import MissingPackage, UserError, one_line
from prw.files import replacing
from prw.motion import Motion, fig4
from prw.recording import Recording, read
from prw.simulation import Run, simulate
from prw.testbed import existing_fmu

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HELP = "simulate the paper's experiment or a recording"
EXAMPLES = """\
examples:
  prw simulate                                        the paper's experiment (Fig. 4) -> out/fig4.csv, out/fig4.png
  prw simulate --set k1=100 --out soft                the same with softer couplings, N.m/rad
  prw simulate motors.csv --degrees                   recorded motor angles in degrees
  prw simulate motors.csv --names 'theta1=Motor 1' --names 'theta2=Motor 2' --animate motors.html
"""
#: A recording of a clone, which a hint names if the current directory is the clone.
RECORDING = Path("examples/point_to_point.csv")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "file",
        type=Path,
        nargs="?",
        metavar="FILE",
        help="CSV recording with columns time (s), theta1, theta2 (rad) and, if known, omega1, omega2 (rad/s); other "
        "units in the header, as in `theta1 [deg]` (default: the paper's experiment)",
    )
    parser.add_argument("--input", type=Path, metavar="FILE", help="the recording, as FILE")
    add_parameter_options(parser, "SI")
    add_reading_options(parser)
    add_paths(parser)
    parser.add_argument(
        "--animate",
        type=Path,
        metavar="FILE",
        help="also write an animation: a .gif, an .mp4 (needs the extra prw[movie]) or an .html",
    )


def run(arguments: argparse.Namespace) -> None:
    """Carry out `prw simulate`. Raises UserError with a message of one line."""
    if arguments.file is not None and arguments.input is not None:
        raise UserError(f"{arguments.file} and --input {arguments.input}: give one recording")
    arguments.input = arguments.file or arguments.input
    if arguments.animate is not None:
        suffix_of(arguments.animate)
    recorded = arguments.input is not None
    if recorded:
        motion: Motion | Recording = call(read, arguments, path=arguments.input)
        title = f"Response to {one_line(arguments.input.name)}"
    else:
        if arguments.degrees is not None:
            raise UserError("--degrees and --radians belong to a recording; the paper's experiment is in radians")
        for name in ("units", "names", "skip", "encoding"):
            if getattr(arguments, name):
                raise UserError("belongs to a recording; name its file, or omit this", argument=name)
        motion, title = fig4(), "Fig. 4: opposite motor velocities"
    table, figure_path = (arguments.out / f"{motion.name}{suffix}" for suffix in (".csv", ".png"))
    if recorded and table.exists() and table.samefile(arguments.input):
        raise UserError(
            f"{table}: is the recording itself and would be overwritten; choose another directory with --out"
        )
    given = parameters_of(arguments)
    response = call(simulate, arguments, motion=motion, parameters=given)
    response.to_csv(table)
    written, missing = [table], ""
    try:
        write_png(figure_path, response.plot(title, angles=recorded))
        written.append(figure_path)
    except MissingPackage as error:
        missing = str(error)
    if arguments.animate is not None:
        animate(response, arguments.animate)
        written.append(arguments.animate)
    show(*_summary(arguments, response, given, written, missing))


def write_png(path: Path, figure: Figure) -> None:
    """Write the figure to `path` atomically."""
    with replacing(path) as temporary:
        figure.savefig(temporary, dpi=150)


def _summary(
    arguments: argparse.Namespace, response: Run, given: Mapping[str, Any], written: Sequence[Path], missing: str
) -> list[str]:
    """The inputs, the key figures and a hint, one line each."""
    motion = response.motion
    time, steps = motion.time, np.diff(motion.time)
    even = np.ptp(steps) < 1e-6 * steps.mean() + 4 * np.spacing(np.abs(time).max())
    spacing = (
        f"steps of {steps.mean() * 1e3:.4g} ms"
        if even
        else (f"steps from {steps.min() * 1e3:.4g} to {steps.max() * 1e3:.4g} ms")
    )
    source = "the paper's experiment (Sec. 4, Fig. 4)" if arguments.input is None else str(arguments.input)
    rates = "rates from omega1, omega2" if motion.omega is not None else "rates from the angles"
    lines = [f"simulated   {source}: {time[-1] - time[0]:.4g} s in {spacing}, {rates}"]
    if given:
        lines.append(f"with        {', '.join(f'{name} {value:.5g}' for name, value in given.items())} (SI)")

    # A note may say that the figures below are wrong.
    lines += [f"note        {note}" for note in response.notes]

    def peak(*names: str) -> float:
        return max(float(np.abs(response[name]).max()) for name in names)

    lines.append(
        f"peaks       pitch rate {_tidy(peak('pitch_rate'))} rad/s, roll rate {_tidy(peak('roll_rate'))} rad/s, "
        f"torque {_tidy(peak('tau1', 'tau2'))} N.m"
    )
    if arguments.input is None:
        lines.append("            motors at opposite rates turn the wrist about its roll axis only, as in the paper")
    else:
        lines.append(f"at the end  pitch {_degrees(response['pitch'][-1])}, roll {_degrees(response['roll'][-1])}")
    lines += _differences(response)
    lines.append(f"wrote       {', '.join(map(str, written))}")
    if missing:
        lines.append(f"no figure   {missing}")
    look = f"look at {written[min(1, len(written) - 1)]}"
    if arguments.input is None:
        recording = RECORDING if RECORDING.is_file() else "motors.csv"
        lines += [f"next        {look}, then simulate a recording:", f"            {_program()} simulate {recording}"]
    else:
        lines.append(
            f"next        {look}; {existing_fmu(arguments.fmu)} also runs in FMPy, OpenModelica and other tools"
        )
    return lines


def _differences(response: Run) -> list[str]:
    """The measured minus the simulated values, one line for each measured output. Their mean is mostly the sensor's offset."""
    rows = []
    for name, difference in response.differences.items():
        known = ~np.isnan(difference)
        if known.any():
            factor, unit = (float(np.rad2deg(1)), "deg") if QUANTITIES[name] == "angle" else (1.0, si_unit(name))
            mean, rest = float(difference[known].mean()), float(difference[known].std())
            span = float(np.ptp(response.measured[name][known]))
            share = f", {rest / span:.2%} of the measured range" if span else ""
            rows.append(
                f"{name} {factor * mean:+.2g} {unit} on average; without that {factor * rest:.2g} {unit} rms{share}"
            )
    return [f"{head:<11} {row}" for head, row in zip(["differences", *[""] * len(rows)], rows)]


def _program() -> str:
    """The program as a user has to type it: its path, unless the shell finds it by its name."""
    started = sys.argv[0]
    return shlex.quote(started) if Path(started).stem == "prw" and shutil.which("prw") != started else "prw"


def _tidy(value: float) -> str:
    # Values below 1e-12 are rounding errors.
    return "0" if value < 1e-12 else f"{value:.3g}"


def _degrees(angle: float) -> str:
    return f"{np.rad2deg(angle):.2f} deg"
