"""Limits of the machine: fmu-check under a limit on the size of files, and with names that are not UTF-8."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
from built import ROOT, built
from file_limits import run_limited

pytestmark = pytest.mark.skipif(os.name != "posix", reason="limits and names of POSIX")

CHECK = [os.fsencode(ROOT / "target" / "debug" / "cargo-fmu"), b"fmu", b"check", b"--only", b"description", b"--fmu"]


@pytest.mark.parametrize("limit", [0, 10_000, 300_000])
def test_an_fmu_that_cannot_be_unpacked(tmp_path: Path, limit: int) -> None:
    """The message is one line, and no report and no part of the FMU remains."""
    done = run_limited([*CHECK, built("prw_testbed.fmu", "fmu"), b"--out", b"report"], tmp_path, limit)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert "cannot be unpacked" in done.stderr and "File too large" in done.stderr
    assert [path.name for path in tmp_path.rglob("*")] == ["temporary"]


def test_names_that_are_not_utf8(tmp_path: Path) -> None:
    directory = os.fsencode(tmp_path) + b"/caf\xe9"
    os.mkdir(directory)
    fmu, out = (directory + name for name in (b"/f\xff.fmu", b"/out"))
    Path(os.fsdecode(fmu)).write_bytes(built("prw_testbed.fmu", "fmu").read_bytes())
    done = subprocess.run([*CHECK, fmu, b"--out", out], capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert b"report.json" in os.listdir(out)
