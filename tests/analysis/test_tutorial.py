"""Runs the commands of python/prw/tutorial.md in order, except `make`, and checks the results."""

from __future__ import annotations

import contextlib
import io
import json
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from built import ROOT, program
from lxml import etree

TUTORIAL = ROOT / "python" / "prw" / "tutorial.md"
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```$", re.S | re.M)


@pytest.mark.filterwarnings("ignore:tau. may be off")
def test_the_commands_work_as_on_the_page(prw, tmp_path, fmu, monkeypatch):
    if not shutil.which("cargo"):
        pytest.skip("no cargo")
    (tmp_path / "target" / "fmu").mkdir(parents=True)
    shutil.copy(fmu, tmp_path / "target" / "fmu")
    shutil.copytree(ROOT / "examples", tmp_path / "examples", ignore=shutil.ignore_patterns("*-fmu"))
    monkeypatch.setenv("PRW_FMU", str(fmu))
    reported, is_built = "", False
    for language, block in BLOCK.findall(TUTORIAL.read_text(encoding="utf-8")):
        if language == "python":
            exec(compile(block, str(TUTORIAL), "exec"), {})
            continue
        for line in block.strip().splitlines():
            if line.startswith("make "):
                continue  # The files exist already, because this test runs after `make` has built them.
            command = line.split()
            if command[0] == "cargo":
                # The description shows that the parameters arrive; dev/build_fmu/tests/packaging.rs compiles such FMUs.
                assert line.startswith("cargo run --release --bin build_fmu -- ")
                command = [*program("build_fmu"), *command[command.index("--") + 1 :], "--describe"]
                command = [str(tmp_path / w) if w.startswith("out/") or w == "mine" else w for w in command]
                result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=600)
                is_built = True
            elif command[0] == "python":
                result = run_script(command[1:], monkeypatch)
            else:
                assert command[0] == "prw"
                if "--fmu" in command:
                    command[command.index("--fmu") + 1] = "target/fmu/prw_testbed.fmu"
                else:
                    assert not is_built, f"{line}: does not use the FMU with the identified parameters"
                result = prw(*command[1:], with_fmu=False)
            assert result.returncode == 0, f"{line}\n{result.stdout}{result.stderr}"
            reported += result.stdout
    rigs = re.findall(r"true parameters of the rig: (.*)", reported)
    for truth, directory in zip(rigs, ("identified", "friction"), strict=True):
        rig = dict(re.findall(r"(\w\d) ([\d.e+-]+) N\.m", truth))
        found = json.loads((tmp_path / "out" / directory / "report.json").read_text())["parameters"]
        for name in ("k1", "k2", "c1", "c2", "c3"):
            off = np.log(found[name]["value"] / float(rig[name]))
            assert abs(off) < 0.01, f"{name} {off:+.2%}"
    start = starts_of(tmp_path / "mine" / "modelDescription.xml")
    identified = json.loads((tmp_path / "out" / "identified" / "report.json").read_text())["parameters"]
    assert {name: start[name] for name in identified} == {
        name: pytest.approx(entry["value"], rel=1e-14) for name, entry in identified.items()
    }
    assert start["M"] == 4 and start["N"] == 7
    # The page shows lines of the results, and the k1 of the second rig.
    page = TUTORIAL.read_text(encoding="utf-8")
    shown = [line for text in re.findall(r"^```text\n(.*?)^```$", page, re.S | re.M) for line in text.splitlines()]
    assert len(shown) == 16 and [line for line in shown if line not in reported] == []
    assert f"prints {rig['k1']} N.m/rad" in page
    for name in ("report.html", "report.json", "identified.json", "identified.ssv"):
        assert (tmp_path / "out" / "identified" / name).is_file()
    assert (tmp_path / "out" / "sweep" / "runs.parquet").is_file()


def starts_of(description: Path) -> dict[str, float]:
    """The start values of the numbers in a model description of FMI 2.0."""
    variables = etree.parse(str(description)).iterfind(".//ScalarVariable")
    numbers = [v for v in variables if v[0].tag in ("Real", "Integer") and v[0].get("start")]
    return {v.get("name"): float(v[0].get("start")) for v in numbers}


def run_script(command: list[str], monkeypatch) -> subprocess.CompletedProcess[str]:
    """Runs a Python script in this process, in which the packages are imported already."""
    out = io.StringIO()
    with monkeypatch.context() as patch, contextlib.redirect_stdout(out):
        patch.setattr(sys, "argv", command)
        runpy.run_path(command[0], run_name="__main__")
    return subprocess.CompletedProcess(command, 0, out.getvalue(), "")
