"""fmu-check reports exactly the notes on the packed FMUs that docs/checking.md lists, plus `package.glibc` where it applies."""

from __future__ import annotations

import json
import re
import subprocess
import zipfile
from pathlib import Path

import pytest
from built import ROOT, built

from tools.documentation.sources import read_table

CHECK = ROOT / "target" / "debug" / "cargo-fmu"


def listed(model: str) -> list[tuple[str, str, str]]:
    """Returns severity, name and observation of the notes that the documentation lists for an FMU."""
    rows = read_table(ROOT / "docs" / "checking.md", "This project's FMUs").rows
    return [("note", name.strip("`"), observation) for name, fmus, observation, _ in rows if model in fmus.split(", ")]


def needs_new_system(fmu: Path, directory: Path) -> bool:
    """Returns whether the library needs a glibc newer than 2.28, which depends on the system that linked it."""
    with zipfile.ZipFile(fmu) as files:
        names = [name for name in files.namelist() if name.endswith((".so", ".dll", ".dylib"))]
        library = files.extract(names[0], directory)
    if not library.endswith(".so"):
        return False
    # readelf belongs to the linker.
    command = ["readelf", "--version-info", library]
    needed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    return any(int(minor) > 28 for minor in re.findall(r"Name: GLIBC_2\.(\d+)", needed))


@pytest.mark.parametrize(
    "model",
    ["prw_testbed", *(pytest.param(name, marks=pytest.mark.long) for name in ("prw_controller", "prw_motor"))],
)
def test_only_listed_notes_are_found(version: str, model: str, tmp_path: Path) -> None:
    fmu = built(f"{version}{model}.fmu")
    # The check takes about 20 seconds. The limits are much longer, so that it reaches every topic on a busy machine, too.
    command = [CHECK, "fmu", "check", "--fmu", fmu, "--json", "--no-shrink", "--repeat", "0.3", "--time", "1500"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=1800)
    report = json.loads(run.stdout)
    assert report["interfaces"] == ["Co-Simulation", "Model Exchange"], run.stderr
    assert report["unreached"] == []
    # An observation begins with a function, whose name depends on the FMI version, so the part up to “ with ” is cut off.
    found = [
        (finding["severity"], finding["name"], observed.split(" with ", 1)[-1])
        for finding in report["findings"]
        for observed in [finding["observed"], *finding["more"]]
        if finding["name"] != "package.glibc"
    ]
    assert sorted(found) == sorted(listed(model))
    assert any(finding["name"] == "package.glibc" for finding in report["findings"]) == needs_new_system(fmu, tmp_path)
    assert run.returncode == 0, run.stderr
