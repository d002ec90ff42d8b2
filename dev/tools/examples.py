"""Runs the examples and writes docs/examples.md and its figures: the purpose, the figure and the output of each example.
Run it in the repository root."""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import runpy
from pathlib import Path

from prw.files import write_text
from tools.figures.writing import write_small_png

PAGE, FIGURES = Path("docs/examples.md"), Path("docs/examples")
EXAMPLES = (
    "lqr",
    "quiet_motion",
    "identify",
    "tolerances",
    "gains",
    "task",
    "predictive_control",
    "torque_driven",
)
#: The durations and the rate that examples measure and print.
TIMES = re.compile(r"(?<= s in )[\d.]+(?= s$)|^[\d.]+(?= decisions per second)", re.MULTILINE)
HEAD = """# Examples

<!-- written by make docs -->

These short programs show what you can do with the FMU and the package prw, and are meant to be changed. `make examples` installs the
packages that they need and builds the FMUs. Then run one of them in the root of the repository: `.venv/bin/python examples/lqr.py`. It
writes its figure into that directory, as `lqr.png`, and so do the others, but `identify.py` writes a report, `out/identify/report.html`."""

HELP = f"run the examples and write {PAGE}"


def run(arguments: argparse.Namespace) -> None:
    """Carry out `tools examples`. Raises UserError with a message of one line."""
    page = "\n\n".join([HEAD, *map(section, EXAMPLES)]) + "\n"
    if PAGE.is_file() and without_times(page) == without_times(PAGE.read_text(encoding="utf-8")):
        print(f"{PAGE} is up to date")
        return
    write_text(PAGE, page)
    print(f"{PAGE} written")


def without_times(page: str) -> str:
    """The page without the durations and rates, which differ from run to run."""
    return TIMES.sub("", page)


def section(name: str) -> str:
    """Runs one example, writes its figure if it has one, and returns its section of the page."""
    path = Path("examples", f"{name}.py")
    example, printed = runpy.run_path(str(path)), io.StringIO()
    title, _, about = example["__doc__"].strip().partition("\n\n")
    about = about.rpartition("\n\n    ")[0]
    with contextlib.redirect_stdout(printed):
        found = example["main"]()
    parts = [f"## {title}", about]
    if isinstance(found, tuple):
        write_small_png(FIGURES / f"{name}.png", found[0])
        parts.append(f"![{title}](examples/{name}.png)")
    parts.append(f"[{path.name}](../{path.as_posix()}) prints\n\n```text\n{printed.getvalue().strip()}\n```")
    return "\n\n".join(parts)
