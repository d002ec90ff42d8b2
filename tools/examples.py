"""`tools examples`: runs the examples and writes docs/examples.md: what each is for, its figure, what it prints, its code."""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import runpy
from pathlib import Path
from typing import Any

from prw.files import write_text
from tools.figures.writing import write_small_png

PAGE, FIGURES = Path("docs/examples.md"), Path("docs/examples")
EXAMPLES = ("lqr", "quiet_motion", "identify", "tolerances", "gains", "learned_move", "predictive_control")
#: The durations and the rate that examples measure and print.
TIMES = re.compile(r"(?<= s in )[\d.]+(?= s$)|(?<=^learned in )[\d.]+|^[\d.]+(?= decisions a second)", re.MULTILINE)
HEAD = """# Examples

<!-- written by make docs -->

Short programs on top of the FMU and of the Python package `prw`, to read and to change. `make examples` installs what
they need and builds the FMUs; each runs from the project's folder."""


def add_parser(subparsers: Any) -> None:
    """Add `examples` to the subcommands."""
    parser = subparsers.add_parser(
        "examples",
        help=f"run the examples and write {PAGE} anew",
        description=f"Runs the examples and writes {PAGE} and its figures anew. To be run in the project's folder.",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Carry out `tools examples`. Raises UserError with one line on what is wrong."""
    page = "\n\n".join([HEAD, *map(section, EXAMPLES)]) + "\n"
    if PAGE.is_file() and without_times(page) == without_times(PAGE.read_text(encoding="utf-8")):
        print(f"{PAGE} is up to date")
        return
    write_text(PAGE, page)
    print(f"{PAGE} written")


def without_times(page: str) -> str:
    """The page without what depends on the speed of the computer, which differs from run to run."""
    return TIMES.sub("", page)


def section(name: str) -> str:
    """The part of the page about one example, which is run; its figure is written beside the page."""
    path = Path("examples", f"{name}.py")
    example, said = runpy.run_path(str(path)), io.StringIO()
    title, _, about = example["__doc__"].strip().partition("\n\n")
    about, _, command = about.rpartition("\n\n    ")
    with contextlib.redirect_stdout(said):
        found = example["main"]()
    parts = [f"## {title}", about, f"```sh\n{command}\n```"]
    if isinstance(found, tuple):
        write_small_png(FIGURES / f"{name}.png", found[0])
        parts.append(f"![{title}](examples/{name}.png)")
    parts.append(f"It prints\n\n```text\n{said.getvalue().strip()}\n```")
    code = path.read_text(encoding="utf-8").split('"""\n', 1)[1].strip()
    parts.append(f"<details><summary><code>{path.as_posix()}</code></summary>\n\n```python\n{code}\n```\n\n</details>")
    return "\n\n".join(parts)
