"""`python -m tools`: the commands behind `make docs`, `make figures`, `make validation` and `make closed-loop`."""

import sys

from prw.cli import run
from tools import closed_loop, compatibility, documentation, figures, validation

sys.exit(
    run(
        "tools",
        "What only this repository needs.",
        (documentation, figures, validation, closed_loop, compatibility),
        None,
    )
)
