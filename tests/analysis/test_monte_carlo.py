"""The campaign of simulated rigs runs, and draws the same figure again."""

from __future__ import annotations

import json
import re
import sys

import monte_carlo
import pytest
import rig
from built import ROOT


@pytest.mark.long
def test_one_rig_without_a_fault_and_one_with(fmu, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(monte_carlo, "FAULTS", {"gain": ("gain of tau1, % too much", (10.0,))})
    monkeypatch.setattr(monte_carlo, "commit", lambda: "0123abc")

    def run(*options):
        monkeypatch.setattr(sys, "argv", ["monte_carlo.py", str(fmu), "--workers", "1", *map(str, options)])
        monte_carlo.main()

    run("--repetitions", 1, "--out", tmp_path / "clean.json")
    clean = json.loads((tmp_path / "clean.json").read_text())
    assert clean["fits"] == 1 and clean["commit"] == "0123abc" and "1 repetitions" in capsys.readouterr().out
    assert all(abs(entry["bias"]) < 0.02 for entry in clean["parameters"].values())

    figure, out = tmp_path / "detection.svg", tmp_path / "detection.json"
    run("--faulty", 1, "--figure", figure, "--out", out)
    rows = json.loads(out.read_text())["faults"]
    assert rows["gain"][0]["does_not_fit"] == 1
    monte_carlo.draw(rows, tmp_path / "again.svg")
    assert (tmp_path / "again.svg").read_bytes() == figure.read_bytes()


@pytest.mark.long
def test_rigs_with_what_reality_adds(fmu, tmp_path, monkeypatch):
    chosen = ("friction", "crosstalk", "jitter", "wrapped", "springs, turned")
    monkeypatch.setattr(monte_carlo, "REAL", {name: monte_carlo.REAL[name] for name in ("nothing", *chosen)})
    monkeypatch.setattr(monte_carlo, "commit", lambda: "0123abc")
    out = tmp_path / "real.json"
    arguments = ["monte_carlo.py", str(fmu), "--workers", "1", "--real", "1", "--seed", "7", "--out", str(out)]
    monkeypatch.setattr(sys, "argv", arguments)
    assert monte_carlo.main() == 0
    rows = json.loads(out.read_text())["real"]
    assert all(rows[name]["named"] == 1 for name in chosen), rows
    assert rows["nothing"]["accepted"] == 5 and rows["friction"]["accepted"] == 1 and rows["crosstalk"]["accepted"] == 0


def test_the_command_for_the_table_of_the_tutorial_repeats_it():
    page = (ROOT / "python/prw/tutorial.md").read_text(encoding="utf-8")
    rigs, faulty = map(int, re.search(r"`make monte-carlo RIGS=(\d+) FAULTY=(\d+)", page).groups())
    clean, intervals = map(int, re.search(r"^\| (\d+) without faults .* of (\d+) intervals", page, re.M).groups())
    assert clean == rigs and intervals == rigs * len(rig.NAMES)
    cases = sum(len(sizes) for _, sizes in monte_carlo.FAULTS.values())
    assert int(re.search(r"^\| (\d+) with faults", page, re.M)[1]) == faulty * cases
