"""Runs a command with a limit on the size of the files that it writes."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest


def run_limited(command: Sequence[str | bytes], directory: Path, limit: int) -> subprocess.CompletedProcess[str]:
    """Runs a command in a directory, whose new subdirectory `temporary` is for temporary files. `limit` is in bytes. Skips the test if
    the system has no such limits."""
    resource = pytest.importorskip("resource", reason="POSIX has limits on the size of files")
    temporary = directory / "temporary"
    temporary.mkdir()
    return subprocess.run(
        command,
        cwd=directory,
        env={**os.environ, "TMPDIR": str(temporary)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
        capture_output=True,
        text=True,
        timeout=120,
    )
