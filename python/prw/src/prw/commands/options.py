"""Defaults that several subcommands share."""

from __future__ import annotations

from pathlib import Path

from prw.errors import UserError
from prw.testbed import default_fmu

#: None if there is none: a command that needs an FMU then reports where it was searched for.
DEFAULT_FMU: Path | None
try:
    DEFAULT_FMU = default_fmu()
except UserError:
    DEFAULT_FMU = None
DEFAULT_OUT = Path("out")
