"""Fixtures: FMUs for importers, and a function that records results for docs/compatibility.md."""

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

#: Directory of the results, one file for each test.
RESULTS = ROOT / "target" / "importers"


@pytest.fixture(scope="session")
def tunable(version: str) -> Path:
    """The testbed with tunable parameters."""
    return built(f"tunable/{version}prw_testbed.fmu", "importer-fmus")


@pytest.fixture(scope="session")
def closed_loop() -> Path:
    """The SSP of controller and testbed."""
    return built("prw_closed_loop.ssp")


@pytest.fixture
def record(request):
    """Returns a function that records the result of a test. It also checks that docs/compatibility.md has a row with the same tool,
    version, FMU and way to run it; the result and the date may differ. The table "At a glance" must name the version, too."""

    def record(tool: str, package: str, fmu: str, run: str, seen: str) -> None:
        RESULTS.mkdir(parents=True, exist_ok=True)
        row = {"tool": tool, "version": metadata.version(package), "fmu": fmu, "run": run, "seen": seen}
        row["date"] = datetime.date.today().isoformat()
        name = "".join(c if c.isalnum() else "_" for c in request.node.name)
        (RESULTS / f"{request.path.stem}-{name}.json").write_text(json.dumps(row), encoding="utf-8")
        written = [cells[:4] for cells in read_table(ROOT / PAGE, HEADING).rows]
        assert list(row.values())[:4] in written, (
            f"{PAGE} is out of date; update it with `python dev/tools compatibility`"
        )
        name, glance = re.split(r",| \(", tool)[0], read_table(ROOT / PAGE, "At a glance").rows
        assert any(name in cell and row["version"] in cell for cell, *_ in glance), (
            f"{PAGE}: “At a glance” lacks {name} {row['version']}"
        )

    return record
