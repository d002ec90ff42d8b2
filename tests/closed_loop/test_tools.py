"""`tools closed-loop` and `tools validation`, and the errors that a document states for importers that hold inputs."""

from __future__ import annotations

import html
import json
import re
import subprocess
import sys

import fmpy
import numpy as np
import pytest
from built import FMUS, ROOT, built

from prw.checking.experiments import read_experiments
from prw.cli import run
from tools import validation
from tools.documentation.sources import read_table
from tools.validation import masters, runs


def tools(*arguments):
    command = [sys.executable, "dev/tools", "closed-loop", *arguments]
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT)


@pytest.mark.long
def test_it_writes_figures_and_tables_and_prints_results(closed_loop, tmp_path):
    run = tools("--fmus", str(FMUS), "--out", str(tmp_path))
    assert run.returncode == 0, run.stderr
    for part in ("pitch_ref 30 deg, roll_ref 60 deg", "within 0.1 deg after", "FMPy", "with input derivatives"):
        assert part in run.stdout, run.stdout
    table = np.genfromtxt(tmp_path / "closed_loop.csv", delimiter=",", names=True)
    assert len(table) == closed_loop.steps and "testbedpitch" in "".join(table.dtype.names).replace("_", "")
    for name in ("closed_loop.png", "coupling.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_a_missing_file_is_named(tmp_path):
    run = tools("--fmus", str(tmp_path))
    assert run.returncode == 1 and run.stderr.count("\n") == 1
    assert "prw_closed_loop.ssp: no such file; `make closed-loop` builds it" in run.stderr


def test_the_compatibility_table_names_the_versions_that_run_here():
    rows = read_table(ROOT / "docs/compatibility.md", "At a glance").rows
    for master in masters.MASTERS:
        if master.version() is not None:
            assert any(master.name in tool and master.version() in tool for tool, *_ in rows), master.name


def test_the_errors_of_held_inputs_in_the_document():
    """x' = u - x with u = sin(w t), from x = 0."""
    fmu, w, names = str(built("lag.fmu")), 2 * np.pi, [("time", float), ("u", float)]
    for label, *stated in read_table(ROOT / "docs/importers-known-faults.md", "Inputs that FMPy holds").rows:
        options = {"relative_tolerance": 1e-8} if "1e-8" in label else {}
        found = []
        for interval in (1e-2, 1e-3):
            time = np.linspace(0, 2, round(2 / interval) + 1)
            result = fmpy.simulate_fmu(
                fmu,
                fmi_type="ModelExchange" if "Model Exchange" in label else "CoSimulation",
                stop_time=2,
                output_interval=interval,
                input=np.array(list(zip(time, np.sin(w * time))), dtype=names),
                output=["x"],
                **options,
            )
            at = w * result["time"]
            exact = (np.sin(at) - w * np.cos(at) + w * np.exp(-result["time"])) / (1 + w**2)
            found.append(f"{100 * np.abs(result['x'] - exact).max() / np.abs(exact).max():.1g} %")
        assert found == stated, label


@pytest.fixture
def validate(monkeypatch, tmp_path, fmu):
    """Returns a function that runs the command with one importer and one master, and returns the exit status and the
    contents of both files."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(runs, "IMPORTERS", [i for i in runs.IMPORTERS if i.name == "fmu_run"])
    monkeypatch.setattr(runs.masters, "MASTERS", runs.masters.MASTERS[:1])

    def validate(*arguments):
        options = ["--fmus", str(FMUS), "--out", str(tmp_path), *arguments]
        status = run("tools", "", {"validation": validation}, ["validation", *options])
        return (
            status,
            json.loads((tmp_path / "validation.json").read_text()),
            (tmp_path / "validation.html").read_text(),
        )

    return validate


def test_the_report(validate, fmu, closed_loop):
    status, found, page = validate()
    known = read_experiments(fmu)
    assert status == 0 and all(row["agrees"] and row["share"] < 0.5 for row in found["rows"])
    assert len(found["rows"]) == 2 * len(known) + 1 and found["guid"] in page
    assert "No measured data of the real testbed were available" in page
    shown = html.unescape(re.sub(r"<[^>]*>", " ", page))
    for row in found["rows"]:
        assert row["importer"] in shown and f"{row['share']:.1%}" in shown
    # If k1 or k2 is off by 1 %, the results exceed the tolerances of every experiment.
    for name, shares in found["sensitivity"].items():
        assert shares["k1"] > 1.4 and shares["k2"] > 1.4, name
        assert f"{shares['c3']:.1f}" in shown


def test_a_file_of_another_tool(validate, fmu, tmp_path, capsys):
    reference = read_experiments(fmu)[0].reference
    table = np.column_stack([reference["time"], 1.01 * reference["roll"]])
    np.savetxt(tmp_path / "far.csv", table, delimiter=",", header="time,wrist.roll", comments="")
    status, found, page = validate("--result", f"Tool 1.0={tmp_path / 'far.csv'}")
    assert status == 1 and "Tool 1.0, from the file far.csv" in page and "too far" in page
    assert "fig4_opposite: Tool 1.0, from the file far.csv" in capsys.readouterr().err
    assert [row["agrees"] for row in found["rows"] if "Tool" in row["importer"]] == [False]
    assert validate("--result", "far.csv")[0] == 1
    assert "--result far.csv: write NAME=VALUE" in capsys.readouterr().err
