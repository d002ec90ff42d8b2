"""`python -m tools`: the commands behind `make docs`, `make figures`, `make validation` and `make closed-loop`."""

import sys

from prw.cli import run
from tools import closed_loop, compatibility, documentation, examples, figures, validation

COMMANDS = (documentation, examples, figures, validation, closed_loop, compatibility)
sys.exit(run("tools", "What only this repository needs.", COMMANDS, None))
