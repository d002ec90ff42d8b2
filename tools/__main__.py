"""`python -m tools`: the commands behind `make docs`, `make figures`, `make validation` and `make closed-loop`."""

import sys

from prw.cli import run
from tools import compatibility, documentation, examples, figures, validation
from tools.validation import closed_loop

COMMANDS = (documentation, examples, figures, validation, closed_loop, compatibility)
sys.exit(run("tools", "Tools of this repository.", COMMANDS, None))
