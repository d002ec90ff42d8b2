"""Fixtures: FMUs for importers, and a place for what tests have seen, from which docs/compatibility.md is written."""

from __future__ import annotations

import datetime
import json
import re
from importlib import metadata
from pathlib import Path

import pytest
from built import ROOT, built

from tools.compatibility import HEADING, PAGE
from tools.documentation.sources import read_table

#: What tests have seen, a file each.
SEEN = ROOT / "target" / "importers"


@pytest.fixture(scope="session")
def tunable(version: str) -> Path:
    """The testbed with tunable parameters."""
    return built(f"tunable/{version}prw_testbed.fmu", "importer-fmus")


@pytest.fixture(scope="session")
def closed_loop() -> Path:
    """The SSP of controller and testbed."""
    return built("prw_closed_loop.ssp")


@pytest.fixture
def saw(request):
    """Call it at the end of a test with what was seen: (tool, its pip package, which FMU, what was run, what was seen)."""

    def saw(tool: str, package: str, fmu: str, run: str, seen: str) -> None:
        SEEN.mkdir(parents=True, exist_ok=True)
        row = {"tool": tool, "version": metadata.version(package), "fmu": fmu, "run": run, "seen": seen}
        row["date"] = datetime.date.today().isoformat()
        name = "".join(c if c.isalnum() else "_" for c in request.node.name)
        (SEEN / f"{request.path.stem}-{name}.json").write_text(json.dumps(row), encoding="utf-8")
        written = [said[:4] for said in read_table(ROOT / PAGE, HEADING).rows]
        assert list(row.values())[:4] in written, (
            f"{PAGE} is out of date; `python dev/tools compatibility` writes it anew"
        )
        name, glance = re.split(r",| \(", tool)[0], read_table(ROOT / PAGE, "At a glance").rows
        assert any(name in said and row["version"] in said for said, *_ in glance), (
            f"{PAGE}: “At a glance” lacks {tool}"
        )

    return saw
