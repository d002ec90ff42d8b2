"""Writes A, B, C, D of the testbed's FMU, or of any other with directional derivatives (FMI 2.0 or 3.0), with the names
and units of states, inputs and outputs, and prints the poles."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from prw.commands.options import DEFAULT_OUT, FMU, add_parameter_options, parameters_of, show
from prw.files import write_text
from prw.linearization import linearize
from prw.state_space import StateSpace

HELP = "the linear model of an FMU"


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the command's options."""
    add_parameter_options(parser, "the FMU's unit")
    parser.add_argument("--fmu", type=Path, help=FMU)
    parser.add_argument(
        "--out",
        type=Path,
        default=DEFAULT_OUT / "linear.json",
        metavar="FILE",
        help="file to write (default: %(default)s)",
    )


def run(arguments: argparse.Namespace) -> None:
    """Carry out `prw linearize`. Raises UserError with a message of one line."""
    model = linearize(parameters_of(arguments), fmu=arguments.fmu)
    write_text(arguments.out, json.dumps(content(model), indent=2) + "\n")
    for kind in ("states", "inputs", "outputs"):
        show(f"{kind:<11} {', '.join(getattr(model, kind)) or 'none'}")
    show(f"poles       {', '.join(f'{pole:.6g}' for pole in model.poles()) or 'none'} (1/s)")
    show(f"wrote       {arguments.out}")


def content(model: StateSpace) -> dict[str, Any]:
    """The content of the JSON file."""
    matrices = {name: getattr(model, name).tolist() for name in "ABCD"}
    names = {kind: list(getattr(model, kind)) for kind in ("states", "inputs", "outputs")}
    return {**matrices, **names, "units": dict(model.units)}
