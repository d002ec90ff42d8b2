"""`python dev/tools`: the commands behind `make docs`, `make figures`, `make validation` and `make closed-loop`."""

import sys
from pathlib import Path

sys.path[0] = str(Path(__file__).resolve().parents[1])

from prw.cli import run  # noqa: E402
from tools import documentation, examples, figures, validation  # noqa: E402
from tools.validation import closed_loop  # noqa: E402

COMMANDS = {
    "docs": documentation,
    "examples": examples,
    "figures": figures,
    "validation": validation,
    "closed-loop": closed_loop,
}
sys.exit(run("tools", "Tools of this repository.", COMMANDS, None))
