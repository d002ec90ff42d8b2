"""fmu-check for Windows, under Wine, finds nothing in the FMUs."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import toolchain
from conftest import FMUS, HERE, ROOT
from targets import WINDOWS


@pytest.fixture(scope="module")
def checker(wine: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The program, and the library that Wine lacks."""
    del wine
    build = ["cargo-zigbuild", "build", "--release", "--locked", "--package", "fmu-check", "--target", WINDOWS.triple]
    subprocess.run(build, cwd=ROOT, check=True)
    directory = tmp_path_factory.mktemp("checker")
    shutil.copy(ROOT / "target" / WINDOWS.triple / "release" / "fmu-check.exe", directory)
    zig = [sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu", "-O2", "-shared"]
    library = directory / "bcryptprimitives.dll"
    subprocess.run([*zig, "-o", library, HERE / "windows" / "bcryptprimitives.c", "-ladvapi32"], check=True)
    return directory / "fmu-check.exe"


@pytest.mark.parametrize("fmu", FMUS, ids=["2.0", "3.0"])
def test_a_correct_fmu_has_no_finding(checker: Path, fmu: Path, wine: dict[str, str]) -> None:
    command = [toolchain.WINE, checker, f"Z:{fmu}", "--json", "--time", "900"]
    done = subprocess.run(command, env=wine, input="", capture_output=True, text=True)
    assert done.stdout, done.stderr
    report = json.loads(done.stdout)
    assert [finding for finding in report["findings"] if finding["severity"] != "note"] == []
    assert len(report["interfaces"]) == 2 and report["status"] == 0, report["unreached"]
