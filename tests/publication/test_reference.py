"""The reference of the Python packages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from built import ROOT


def test_docstrings_make_a_reference_without_warnings(tmp_path: Path) -> None:
    """A warning is an unresolved link, an undocumented parameter or a missing section."""
    options = ["--quiet", "--fail-on-warning", "--keep-going", "--doctree-dir", str(tmp_path / "trees")]
    command = [sys.executable, "-m", "sphinx", *options, str(ROOT / "docs/reference"), str(tmp_path / "html")]
    finished = subprocess.run(command, capture_output=True, text=True)
    assert finished.returncode == 0 and not finished.stderr, finished.stderr
    assert "Estimate parameters of the testbed" in (tmp_path / "html/prw.html").read_text(encoding="utf-8")
