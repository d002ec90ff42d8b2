"""Writes the table “Results of tests/importers” of docs/compatibility.md from the results of `make test-importers` in
target/importers."""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path

from prw.errors import UserError
from prw.files import write_text

#: Where tests/importers leave what they saw, a file each, and where it goes; within the project.
SEEN, PAGE, HEADING = Path("target/importers"), Path("docs/compatibility.md"), "Results of tests/importers"
HEADS = ("tool", "version", "fmu", "run", "seen", "date")
TITLES = ("tool", "version", "FMU", "run", "result", "date")

HELP = "write the results of tests/importers into docs/compatibility.md"


def run(_: argparse.Namespace) -> None:
    """Carry out `tools compatibility`. Raises UserError where there is nothing to write, or no place for it."""
    rows = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(SEEN.glob("*.json"))]
    if not rows:
        raise UserError(f"{SEEN}: there is nothing; run `make test-importers` in the project's folder")
    text = PAGE.read_text(encoding="utf-8")
    lines = [f"| {' | '.join(TITLES)} |", "|" + "---|" * len(TITLES)]
    lines += [f"| {' | '.join(row[head] for head in HEADS)} |" for row in rows]
    pattern = rf"(^## {HEADING}\n\n(?:[^|\n][^\n]*\n)*\n?)(?:\|.*\n)*\n*"
    found, count = re.subn(pattern, lambda match: match[1] + "\n".join(lines) + "\n\n", text, count=1, flags=re.M)
    if not count:
        raise UserError(f"{PAGE}: there is no heading “{HEADING}”")
    write_text(PAGE, found)
    print(f"wrote {len(rows)} rows into {PAGE}")
