"""Compares a table of results with one of the reference experiments in the FMU: motions of the motors, and the response
of the testbed, calculated by a program that shares no code with the FMU. Reports for every output the largest
difference, its time, and whether it is within the tolerance, and draws the outputs that exceed it. Exit status 0 if all
agree, else 1, also if FILE has only some of the times, or no output that moves in the experiment. Other outputs may be missing.

FILE is CSV, a .mat file of OpenModelica, or a .mat file that MATLAB saved with -v7 or earlier. Columns are found by name, with
or without a component (testbed.roll). Units are in the header, as in `roll [deg]`, or in --units; otherwise SI.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from prw.checking import check
from prw.commands.options import Named, add_paths, call
from prw.commands.simulate import write_png
from prw.errors import MissingPackage, UserError

HELP = "compare another tool's results with a reference"
EXAMPLES = """\
examples:
  prw check fig4.csv                                the nearest experiment
  prw check wrist_res.mat --experiment closed_loop
  prw check run.csv --units pitch=deg,roll=deg
The experiments as files: unzip the FMU, extra/org.fmi-standard.fmi-ls-ref; documentation/fmi-ls-ref.txt describes them.
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument("file", type=Path, metavar="FILE", help="table of results")
    parser.add_argument("--experiment", metavar="NAME", help="the experiment (default: the nearest one)")
    parser.add_argument("--model-exchange", action="store_true", help="take the tolerances for Model Exchange")
    parser.add_argument(
        "--component", metavar="NAME", help="whose columns count if several have the same name (default: testbed)"
    )
    parser.add_argument("--units", action=Named, metavar="NAME=UNIT,...", help="units of columns whose header has none")
    add_paths(parser, "directory of the figure")


def run(arguments: argparse.Namespace) -> None:
    """Carry out `prw check`. Raises UserError with a message of one line, also if the result does not agree."""
    found = call(check, arguments, result=arguments.file)
    print(found.summary())
    if found.agrees:
        rest = found.missing and f"in {', '.join(found.variables)}; not compared: {', '.join(found.missing)}"
        print(f"agrees      {rest or 'with the reference'}")
        return
    if not found.far:
        raise UserError(f"{arguments.file}: does not show whether it agrees: {'; '.join(found.incomplete)}")
    figure_path = arguments.out / f"{arguments.file.stem}_check.png"
    try:
        write_png(figure_path, found.plot())
        shown = f"{figure_path} shows both"
    except MissingPackage as error:
        shown = f"for a figure of both, {error}"
    raise UserError(f"{arguments.file}: {', '.join(found.far)} too far from {found.experiment.name}; {shown}")
