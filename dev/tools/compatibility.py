"""Writes the table “Results of tests/importers” of docs/compatibility.md from the results of `make test-importers` in
target/importers."""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path

from prw.errors import UserError
from prw.files import write_text

#: Directory with one file for each result of tests/importers; the page with the table of the results, and the table's
#: heading.
RESULTS, PAGE, HEADING = Path("target/importers"), Path("docs/compatibility.md"), "Results of tests/importers"
HEADS = ("tool", "version", "fmu", "run", "seen", "date")
TITLES = ("tool", "version", "FMU", "run", "result", "date")

HELP = "write the results of tests/importers into docs/compatibility.md"


def run(_: argparse.Namespace) -> None:
    """Carry out `tools compatibility`. Raises UserError if there are no results, or if the page lacks the heading."""
    rows = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(RESULTS.glob("*.json"))]
    if not rows:
        raise UserError(f"{RESULTS}: there is nothing; run `make test-importers` in the repository root")
    text = PAGE.read_text(encoding="utf-8")
    lines = [f"| {' | '.join(TITLES)} |", "|" + "---|" * len(TITLES)]
    lines += [f"| {' | '.join(row[head] for head in HEADS)} |" for row in rows]
    pattern = rf"(^## {HEADING}\n\n(?:[^|\n][^\n]*\n)*\n?)(?:\|.*\n)*\n*"
    found, count = re.subn(pattern, lambda match: match[1] + "\n".join(lines) + "\n\n", text, count=1, flags=re.M)
    if not count:
        raise UserError(f"{PAGE}: there is no heading “{HEADING}”")
    write_text(PAGE, found)
    print(f"wrote {len(rows)} rows into {PAGE}")
