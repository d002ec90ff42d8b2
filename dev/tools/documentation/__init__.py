"""Writes the documentation of both FMUs from the text in docs/fmu-page, the tables of the model descriptions,
docs/compatibility.md and the figures that `make figures` has drawn. Writes docs/performance.md from the results of
`make bench` and `make instructions`."""

from __future__ import annotations

import argparse
from pathlib import Path

from prw.files import write_text

PROJECT = Path(".")

HELP = "write the FMUs' documentation and docs/performance.md"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--project", type=Path, default=PROJECT, metavar="DIR", help="the repository root (default: %(default)s)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Carry out `tools docs`. Raises UserError with a message of one line, and then writes no file."""
    # Loaded when they are needed: FMPy takes a while.
    from tools.documentation import performance
    from tools.documentation.pages import PAGES, render

    project = arguments.project
    contents = {page.path: render(project, page) for page in PAGES}
    contents[performance.PAGE] = performance.render(project)
    for name, content in contents.items():
        path = project / name
        if path.is_file() and path.read_bytes() == content.encode():
            print(f"{path} is up to date")
            continue
        write_text(path, content)
        print(f"{path} written, {len(content.encode()) // 1000} kB")
