"""The programs in fmu-run's README run as they stand."""

from __future__ import annotations

import re

from built import ROOT


def test_the_programs_run(fmu, monkeypatch):
    page = "crates/fmu-run/README.md"
    programs = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), flags=re.S | re.M)
    text = "\n".join(program for program in programs if "fmu_run" in program)
    monkeypatch.chdir(ROOT)
    names: dict = {}
    exec(compile(text, page, "exec"), names)
    runs = names["runs"].check()
    assert runs["roll"].shape == (1000, 2001) and abs(runs["roll"]).max() > 0.01
    assert names["torques"].shape == (1000, 2) and names["wrists"].errors == {}
    assert len({*names["wrists"].time}) == 2, "some have gone back"
    assert names["peaks"]["tau1", "peak"].max() == abs(runs["tau1"]).max()
    assert names["rewards"].shape == (1024,) and (names["envs"].steps == 100).all()
