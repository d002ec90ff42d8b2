"""`tools docs`: the pages that travel in the FMUs."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from prw.files import replacing

PROJECT = Path(".")


def add_parser(subparsers: Any) -> None:
    """Add `docs` to the subcommands."""
    parser = subparsers.add_parser(
        "docs",
        help="write the FMUs' documentation anew",
        description="Writes the documentation of both FMUs from the text in docs/fmu-page, the tables of the model "
        "descriptions, docs/compatibility.md and the figures that `make figures` has made.",
    )
    parser.add_argument(
        "--project", type=Path, default=PROJECT, metavar="DIR", help="the project's folder (default: %(default)s)"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Carry out `tools docs`. Raises UserError with a message of one line, and then writes no file."""
    # Loaded when they are needed: FMPy takes a while.
    from tools.documentation.pages import PAGES, render

    project = arguments.project
    texts = {page.path: render(project, page) for page in PAGES}
    for name, text in texts.items():
        path = project / name
        if path.is_file() and path.read_bytes() == text.encode():
            print(f"{path} is up to date")
            continue
        with replacing(path) as temporary:
            temporary.write_bytes(text.encode())
        print(f"{path} written, {len(text.encode()) // 1000} kB")
