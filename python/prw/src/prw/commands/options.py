"""What several subcommands take as their default."""

from __future__ import annotations

from pathlib import Path

from prw.testbed import default_fmu

DEFAULT_FMU = default_fmu()
DEFAULT_OUT = Path("out")
