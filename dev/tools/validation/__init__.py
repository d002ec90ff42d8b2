"""Runs the reference experiments with the testbed for FMI 2.0 and FMI 3.0 under every importer that is installed, and
the closed loop under every master. Compares the results with the reference, and finds out which changes of parameters
the tolerances detect. Writes validation.html and validation.json."""

from __future__ import annotations

import argparse
from pathlib import Path

from prw.commands.options import DEFAULT_OUT, Named
from prw.errors import UserError

DEFAULT_FMUS = Path("target/fmu")

HELP = "compare the FMUs with the reference experiments under every importer"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add_directories(parser)
    parser.add_argument(
        "--result",
        action=Named,
        read=Path,
        metavar="TOOL=FILE",
        help="also compare this file, which another tool wrote, as `prw check` does; TOOL is its name and version. May be "
        "repeated",
    )


def add_directories(parser: argparse.ArgumentParser) -> None:
    """Add the options --fmus and --out."""
    for option, default, use in (
        ("--fmus", DEFAULT_FMUS, "of the FMUs and the closed loop"),
        ("--out", DEFAULT_OUT, "to write into"),
    ):
        parser.add_argument(
            option, type=Path, default=default, metavar="DIR", help=f"directory {use} (default: %(default)s)"
        )


def run(arguments: argparse.Namespace) -> None:
    """Carry out `tools validation`. Raises UserError with a message of one line, also if a run does not
    agree."""
    # SciPy and FMPy take a while to load.
    from prw.files import write_text
    from tools.validation.page import page
    from tools.validation.runs import validate

    found = validate(arguments.fmus, arguments.result)
    write_text(arguments.out / "validation.json", found.to_json())
    write_text(arguments.out / "validation.html", page(found))
    for row in found.rows:
        print(f"{'agrees' if row.agrees else 'TOO FAR':<8} {row.share:6.1%} of the tolerance  {row}")
    print(f"wrote    {arguments.out / 'validation.html'}, {arguments.out / 'validation.json'}")
    far = [str(row) for row in found.rows if not row.agrees]
    if far:
        raise UserError(f"too far from the reference: {'; '.join(far)}")
