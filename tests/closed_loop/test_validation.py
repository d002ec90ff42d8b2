"""`tools validation`: every number on the page is from a run, and what is too far off is said."""

from __future__ import annotations

import html
import json
import re

import numpy as np
import pytest
from built import FMUS, ROOT

from prw.checking.experiments import read_experiments
from prw.cli import run
from tools import validation
from tools.validation import runs


@pytest.fixture
def validate(monkeypatch, tmp_path, fmu):
    """Runs the command with one importer and one master; returns its status and both files."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(runs, "IMPORTERS", [i for i in runs.IMPORTERS if i.name == "fmu_run"])
    monkeypatch.setattr(runs.masters, "MASTERS", runs.masters.MASTERS[:1])

    def validate(*arguments):
        status = run("tools", "", [validation], ["validation", "--fmus", str(FMUS), "--out", str(tmp_path), *arguments])
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
    text = html.unescape(re.sub(r"<[^>]*>", " ", page))
    for row in found["rows"]:
        assert row["importer"] in text and f"{row['share']:.1%}" in text
    # Every experiment tells 1 % of a stiffness.
    for name, shares in found["sensitivity"].items():
        assert shares["k1"] > 1.4 and shares["k2"] > 1.4, name
        assert f"{shares['c3']:.1f}" in text


def test_a_file_of_another_tool(validate, fmu, tmp_path, capsys):
    reference = read_experiments(fmu)[0].reference
    table = np.column_stack([reference["time"], 1.01 * reference["roll"]])
    np.savetxt(tmp_path / "far.csv", table, delimiter=",", header="time,wrist.roll", comments="")
    status, found, page = validate("--result", f"Tool 1.0={tmp_path / 'far.csv'}")
    assert status == 1 and "Tool 1.0, from the file far.csv" in page and "too far" in page
    assert "fig4_opposite: Tool 1.0, from the file far.csv" in capsys.readouterr().err
    assert [row["agrees"] for row in found["rows"] if "Tool" in row["importer"]] == [False]
    assert validate("--result", "far.csv")[0] == 1
    assert "write TOOL=FILE" in capsys.readouterr().err
