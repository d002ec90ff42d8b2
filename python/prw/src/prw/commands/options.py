"""What several subcommands take as their default."""

from __future__ import annotations

from pathlib import Path

from prw.errors import UserError
from prw.testbed import default_fmu

#: None if there is none: a command that needs one then says where it was looked for.
DEFAULT_FMU: Path | None
try:
    DEFAULT_FMU = default_fmu()
except UserError:
    DEFAULT_FMU = None
DEFAULT_OUT = Path("out")
