"""Reproduces the paper's Figs. 4 and 5 and draws Bode plots of the torques, poles and zeros, step responses and the
order of convergence, all from the FMU. Writes each figure as SVG and PNG, and the numbers that the page of the FMU quotes
as numbers.json."""

from __future__ import annotations

import argparse
from pathlib import Path

from prw.commands.options import add_paths
from prw.files import write_text
from prw.testbed import existing_fmu

#: Directory of the figures that git tracks, for the documentation and the README.
COMMITTED = Path("docs/fmu-page/figures")
#: The first image of the README, an animation of the wrist.
ANIMATION = Path("docs/wrist.gif")
#: The second image of the README, a screencast of the page in the FMU.
SCREENCAST = Path("docs/try-it.gif")

HELP = "reproduce the paper's figures from runs of the FMU"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add_paths(parser)
    parser.add_argument(
        "--commit",
        action="store_true",
        help=f"also renew the copies kept with the sources, in {COMMITTED}, {ANIMATION} and {SCREENCAST} (with the browser chromium)",
    )


def run(arguments: argparse.Namespace) -> None:
    """Carry out `tools figures`. Raises UserError with a message of one line."""
    # FMPy and matplotlib take a while to load.
    from tools.figures.plots import figures
    from tools.figures.results import numbers, results
    from tools.figures.writing import write_for_page, write_png, write_small_png, write_svg

    fmu = existing_fmu(arguments.fmu)
    found = results(fmu)
    drawn = figures(found)
    for name, figure in drawn.items():
        write_svg(arguments.out / f"{name}.svg", figure.figure)
        write_png(arguments.out / f"{name}.png", figure.figure)
    write_text(arguments.out / "numbers.json", numbers(found))
    print(f"wrote {len(drawn)} figures as SVG and PNG, and numbers.json, into {arguments.out}")
    if arguments.commit:
        for name, figure in drawn.items():
            if figure.for_page:
                write_for_page(COMMITTED / f"{name}.svg", figure.figure)
            if figure.for_readme:
                write_small_png(COMMITTED / f"{name}.png", figure.figure)
        write_text(COMMITTED / "numbers.json", numbers(found))
        from prw.animation import animate
        from tools.figures import screencast
        from tools.figures.animation import SPEED, captioned_run

        run, captions = captioned_run(fmu, fmu.with_name("prw_controller.fmu"))
        animate(run, ANIMATION, speed=SPEED, captions=captions)
        screencast.record(fmu, SCREENCAST)
        print(f"renewed {COMMITTED}, {ANIMATION} and {SCREENCAST}")
