"""Fixtures: the packed FMUs, and a place for what tests have seen, from which docs/compatibility.md is written."""

from __future__ import annotations

import datetime
import importlib.util
import json
import re
import shutil
import sys
from importlib import metadata
from pathlib import Path

import fmpy
import pytest

from tools.compatibility import HEADING, PAGE
from tools.documentation.sources import read_table

ROOT = Path(__file__).resolve().parents[2]
FMUS = ROOT / "target" / "fmu"
sys.path.insert(0, str(ROOT / "tests" / "oracle"))

#: What tests have seen, a file each.
SEEN = ROOT / "target" / "importers"


def built(name: str) -> Path:
    path = FMUS / name
    if not path.is_file():
        pytest.exit(f"{path} is missing; build it with `make importer-fmus`", returncode=1)
    return path


def needed(module: str, package: str) -> None:
    """Skip the tests of a file where the package is not installed."""
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{package} is not installed; `make test-importers` installs it", allow_module_level=True)


@pytest.fixture(scope="session", params=["", "fmi3/"], ids=["fmi2", "fmi3"])
def folder(request) -> str:
    """Of the FMUs of FMI 2.0 and 3.0."""
    return request.param


@pytest.fixture(scope="session")
def testbed(folder) -> Path:
    """The testbed for FMI 2.0 and for FMI 3.0."""
    return built(f"{folder}prw_testbed.fmu")


@pytest.fixture(scope="session")
def tunable(folder) -> Path:
    """The same with tunable parameters."""
    return built(f"tunable/{folder}prw_testbed.fmu")


@pytest.fixture(scope="session")
def closed_loop() -> Path:
    """The SSP of controller and testbed."""
    return built("prw_closed_loop.ssp")


@pytest.fixture
def unpacked():
    """Unpacks FMUs into folders that are removed at the end of a test."""
    folders = []

    def unpack(fmu: Path) -> str:
        folders.append(fmpy.extract(str(fmu)))
        return folders[-1]

    yield unpack
    for made in folders:
        shutil.rmtree(made, ignore_errors=True)


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
            f"{PAGE} is out of date; `python -m tools compatibility` writes it anew"
        )
        name, glance = re.split(r",| \(", tool)[0], read_table(ROOT / PAGE, "At a glance").rows
        assert any(name in said and row["version"] in said for said, *_ in glance), (
            f"{PAGE}: “At a glance” lacks {tool}"
        )

    return saw
