"""The programs in the READMEs run as they stand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("page", ["README.md", "crates/fmu-run/README.md"])
def test_the_program_runs(page, testbed2, monkeypatch):
    programs = re.findall(r"^```python\n(.*?)^```", (ROOT / page).read_text(encoding="utf-8"), flags=re.S | re.M)
    (text,) = (program for program in programs if "fmu_run" in program)
    monkeypatch.chdir(ROOT)
    names: dict = {}
    exec(compile(text, page, "exec"), names)
    runs = names["runs"].check()
    assert runs["roll"].shape == (1000, 2001) and abs(runs["roll"]).max() > 0.01
    if "peaks" in names:
        assert names["peaks"]["tau1", "peak"].max() == abs(runs["tau1"]).max()
