"""Options like --set k1=120: from texts to numbers, with a clear word on what is wrong."""

from __future__ import annotations

import argparse
import contextlib
import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from prw.errors import UserError
from prw.identification import DEFAULT_ESTIMATE
from prw.parameters import values_of
from prw.testbed import existing_fmu, loaded


class FORMATTER(argparse.RawDescriptionHelpFormatter):
    """Keeps the line breaks of descriptions and examples, at the house's width."""

    def __init__(self, prog: str):
        super().__init__(prog, max_help_position=30, width=110)


def add_task_options(parser: argparse.ArgumentParser) -> None:
    """Options on parameters and noise that identification and experiment design share."""
    parser.add_argument(
        "--estimate",
        default=",".join(DEFAULT_ESTIMATE),
        metavar="NAMES",
        help="parameters to estimate, with commas; all others stay fixed (default: %(default)s)",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="start value, or value of a fixed parameter, in SI (default: the FMU's). May be repeated",
    )
    parser.add_argument(
        "--noise",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="standard deviation of a channel's noise in SI, where it is known. May be repeated",
    )


def add_reading_options(parser: argparse.ArgumentParser) -> None:
    """Options on how recordings are written."""
    parser.add_argument(
        "--units",
        default="",
        metavar="NAME=UNIT,...",
        help="units of columns whose header has none; an encoder's counts are theta1=rev/10000",
    )
    parser.add_argument("--degrees", action="store_true", help="columns without a unit are in deg and deg/s, not SI")
    parser.add_argument(
        "--names",
        action="append",
        default=[],
        metavar="NAME=HEADER",
        help="what a column is called in the file, as in 'theta1=Motor 1'. May be repeated",
    )
    parser.add_argument(
        "--skip-lines", type=int, default=0, metavar="N", help="lines above the header, as dSPACE writes them"
    )
    parser.add_argument(
        "--encoding", default="", help="of the file (default: UTF-8, or UTF-16 where the file begins with its mark)"
    )


def reading_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Arguments of `prw.read` from these options."""
    return {
        "units": pairs([arguments.units], "--units"),
        "degrees": arguments.degrees,
        "names": pairs(arguments.names, "--names"),
        "skip": arguments.skip_lines,
        "encoding": arguments.encoding,
    }


def pairs(texts: Iterable[str], option: str) -> dict[str, str]:
    """NAME=TEXT, each perhaps several with commas, as a dict. Raises UserError naming the option."""
    found: dict[str, str] = {}
    for text in texts:
        for part in filter(None, (p.strip() for p in text.split(","))):
            name, equals, value = part.partition("=")
            if not equals or not name.strip() or not value.strip():
                raise UserError(f"{option} {part}: write NAME=VALUE")
            if name.strip() in found:
                raise UserError(f"{option}: {name.strip()} is given twice")
            found[name.strip()] = value.strip()
    return found


def number(text: str, what: str) -> float:
    """A positive number. Raises UserError saying what it was for."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > 0):
        raise UserError(f"{what}: {text!r} is not a positive number")
    return value


def listed(text: str) -> tuple[str, ...]:
    """Names with commas, each once."""
    return tuple(dict.fromkeys(filter(None, (part.strip() for part in text.split(",")))))


def add_parameter_options(parser: argparse.ArgumentParser, unit: str) -> None:
    """Options on the parameters of a run or a model."""
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"start value in {unit} (default: the FMU's). May be repeated",
    )
    parser.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE",
        help="parameters in JSON, as `prw identify` writes; --set is stronger",
    )


def parameters_of(arguments: argparse.Namespace, fmu: Path | None) -> dict[str, Any]:
    """What these options say."""
    found: dict[str, Any] = {}
    if arguments.parameters is not None:
        with loaded(existing_fmu(fmu)) as inside:
            found = values_of(arguments.parameters, inside)
    for name, text in pairs(arguments.set, "--set").items():
        try:
            found[name] = text == "true" if text in ("true", "false") else float(text)
        except ValueError:
            raise UserError(f"--set {name}={text}: {text!r} is not a number") from None
    return found


def numbers(texts: Iterable[str], option: str) -> dict[str, float]:
    """NAME=VALUE with positive values."""
    return {name: number(text, f"{option} {name}") for name, text in pairs(texts, option).items()}


def spreads(texts: Iterable[str], option: str) -> dict[str, float | tuple[float, float]]:
    """NAME=[VALUE:]PERCENT% as a fraction, or (value, fraction), by name."""
    found: dict[str, float | tuple[float, float]] = {}
    for name, text in pairs(texts, option).items():
        match = re.fullmatch(r"(?:([^:]+):)?\s*([^:%]+)%", text)
        if not match:
            raise UserError(f"{option} {name}={text}: write {name}=10%, or {name}=VALUE:10%")
        fraction = number(match.group(2), f"{option} {name}") / 100
        found[name] = (number(match.group(1), f"{option} {name}"), fraction) if match.group(1) else fraction
    return found


def bounds(texts: Iterable[str]) -> dict[str, tuple[float, float]]:
    """NAME=LOW:HIGH by name."""
    found = {}
    for name, text in pairs(texts, "--bounds").items():
        low, colon, high = text.partition(":")
        if not colon:
            raise UserError(f"--bounds {name}={text}: write {name}=LOW:HIGH")
        found[name] = (number(low, f"--bounds {name}"), number(high, f"--bounds {name}"))
        if found[name][0] >= found[name][1]:
            raise UserError(f"--bounds {name}={text}: the first must be below the second")
    return found


@contextlib.contextmanager
def said_of_options(**options: str) -> Iterator[None]:
    """Turn an error on an argument in Python, `parameters: k9 is not known`, into one on the option that it came from,
    `--set: k9 ...`. options: by argument."""
    try:
        yield
    except UserError as error:
        text = str(error)
        argument = re.split(r"\W", text, maxsplit=1)[0]
        if argument in options:
            raise UserError(f"--{options[argument]}{text.removeprefix(argument)}") from None
        raise
