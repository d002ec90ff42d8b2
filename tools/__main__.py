"""`python -m tools`: the commands behind `make docs`, `make figures` and `make closed-loop`."""

import sys

from prw.cli import run
from tools import closed_loop, documentation, examples, figures

sys.exit(run("tools", "What only this repository needs.", (documentation, examples, figures, closed_loop), None))
