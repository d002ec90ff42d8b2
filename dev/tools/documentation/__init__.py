"""Writes docs/performance.md from the results of `make bench`."""

from __future__ import annotations

import argparse
from pathlib import Path

from prw.files import write_text

PROJECT = Path(".")

HELP = "write docs/performance.md"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    parser.add_argument(
        "--project", type=Path, default=PROJECT, metavar="DIR", help="the repository root (default: %(default)s)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Carry out `tools docs`. Raises UserError with a message of one line, and then writes no file."""
    from tools.documentation import performance

    path, content = arguments.project / performance.PAGE, performance.render(arguments.project)
    if path.is_file() and path.read_bytes() == content.encode():
        print(f"{path} is up to date")
    else:
        write_text(path, content)
        print(f"{path} written, {len(content.encode()) // 1000} kB")
