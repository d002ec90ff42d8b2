"""The program in fmu-run's README runs as it stands."""

from __future__ import annotations

import re

from built import ROOT


def test_the_program_runs(fmu, monkeypatch):
    page = "crates/fmu-run/README.md"
    programs = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), flags=re.S | re.M)
    (text,) = (program for program in programs if "fmu_run" in program)
    monkeypatch.chdir(ROOT)
    names: dict = {}
    exec(compile(text, page, "exec"), names)
    runs = names["runs"].check()
    assert runs["roll"].shape == (1000, 2001) and abs(runs["roll"]).max() > 0.01
    assert names["peaks"]["tau1", "peak"].max() == abs(runs["tau1"]).max()
