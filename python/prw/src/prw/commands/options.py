"""Options that several subcommands share, and options like --set k1=120."""

from __future__ import annotations

import argparse
import inspect
import math
import re
import shutil
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from prw.arguments import values_of
from prw.errors import UserError, one_line
from prw.identification import DEFAULT_ESTIMATE
from prw.testbed import existing_fmu, loaded

DEFAULT_OUT = Path("out")
#: Help of --fmu.
FMU = "the testbed FMU (default: the FMU that PRW_FMU names, else the FMU in this package or in its clone)"
T = TypeVar("T")


def call(function: Callable[..., T], arguments: argparse.Namespace, notes: list[str] | None = None, **others: Any) -> T:
    """Call the function with the options that have the names of its parameters, and with `others`.

    The function's warnings about its results are not shown, because commands print these themselves. notes: gets the messages of
    its UserWarnings."""
    names = inspect.signature(function).parameters
    with warnings.catch_warnings(record=True) as caught:
        warnings.filterwarnings("always", module=__name__)
        found = function(**{name: value for name, value in vars(arguments).items() if name in names} | others)
    for each in caught:
        if each.filename != __file__:
            warnings.warn_explicit(each.message, each.category, each.filename, each.lineno)
        elif notes is not None and each.category is UserWarning:
            notes.append(str(each.message))
    return found


def show(*lines: str) -> None:
    """Print lines. A name in a line, such as a path, may contain any character, but does not break the line."""
    print("\n".join(one_line(line, sys.maxsize) for line in lines))


def add_paths(parser: argparse.ArgumentParser, out: str = "directory to write into", directory: str = "") -> None:
    """Add the options --fmu and --out. out: the help of --out; directory: the default of --out within DEFAULT_OUT."""
    parser.add_argument("--fmu", type=Path, help=FMU)
    default = DEFAULT_OUT / directory
    parser.add_argument("--out", type=Path, default=default, metavar="DIR", help=f"{out} (default: %(default)s)")


class Formatter(argparse.RawDescriptionHelpFormatter):
    """Keeps the line breaks of descriptions and examples. Lines have at most 110 characters, fewer in a narrower terminal."""

    def __init__(self, prog: str):
        width = shutil.get_terminal_size((112, 24)).columns - 2
        super().__init__(prog, max_help_position=30, width=min(width, 110))


def add_task_options(parser: argparse.ArgumentParser) -> None:
    """Options on parameters and noise that identification and experiment design share."""
    parser.add_argument(
        "--estimate",
        type=listed,
        default=",".join(DEFAULT_ESTIMATE),
        metavar="NAMES",
        help="parameters to estimate, separated by commas; all others stay fixed (default: %(default)s)",
    )
    parser.add_argument(
        "--set",
        dest="parameters",
        action=Named,
        read=not_negative,
        metavar="NAME=VALUE",
        help="start value, or value of a fixed parameter, in SI (default: the FMU's). May be repeated",
    )
    parser.add_argument(
        "--noise",
        action=Named,
        read=number,
        metavar="NAME=VALUE",
        help="standard deviation of a channel's noise in SI, if it is known. May be repeated",
    )


def add_reading_options(parser: argparse.ArgumentParser) -> None:
    """Options on the format of recordings."""
    parser.add_argument(
        "--units",
        action=Named,
        metavar="NAME=UNIT,...",
        help="units of columns whose header has none; an encoder's counts are theta1=rev/10000",
    )
    add_unit_options(parser, "columns without a unit are")
    parser.add_argument(
        "--names",
        action=Named,
        metavar="NAME=HEADER",
        help="name of a column in the file, as in 'theta1=Motor 1'. May be repeated",
    )
    parser.add_argument(
        "--skip-lines",
        dest="skip",
        type=integer,
        default=0,
        metavar="N",
        help="lines above the header, as dSPACE writes them",
    )
    parser.add_argument(
        "--encoding",
        default="",
        help="of the file (default: UTF-8, or UTF-16 if the file begins with its byte order mark)",
    )


def add_unit_options(parser: argparse.ArgumentParser, subject: str) -> None:
    """Add --degrees and --radians, which exclude each other. subject: the beginning of their help."""
    both = parser.add_mutually_exclusive_group()
    both.add_argument("--degrees", action="store_const", const=True, help=f"{subject} in deg and deg/s")
    both.add_argument(
        "--radians",
        action="store_const",
        const=False,
        dest="degrees",
        help=f"{subject} in rad and rad/s (default, but it is needed if the motors are then implausibly fast)",
    )


class Named(argparse.Action):
    """Collects NAME=VALUE pairs, separated by commas or from repeated options, in a dict of `read(VALUE)` by name."""

    def __init__(self, read: Callable[[str], Any] = str, **options: Any):
        super().__init__(default={}, **options)
        self.read = read

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: str | None = None
    ) -> None:
        """Add the pairs in the string `values`. Raises UserError naming the option."""
        option, found = str(option), dict(getattr(namespace, self.dest))
        pairs = [[word.strip() for word in part.partition("=")] for part in values.split(",") if part.strip()]
        for name, _, string in pairs:
            if not name or not string:
                hint = "; a comma begins the next one, so decimals need a point" if "," in values else ""
                raise UserError(f"write NAME=VALUE{hint}", argument=option, given=values)
        for name, _, string in pairs:
            if name in found:
                raise UserError(f"{name} is given twice", argument=option)
            try:
                found[name] = self.read(string)
            except ValueError as error:
                raise UserError(str(error), argument=option, given=f"{name}={string}") from None
        setattr(namespace, self.dest, found)


def decimal(string: str) -> float:
    """A number in one of the spellings that tables have: Python would also take 1_000. Raises ValueError."""
    if "_" in string:
        raise ValueError(f"{string!r} is not a number")
    return float(string)


def integer(string: str) -> int:
    """An integer in one of the spellings that tables have. Raises ValueError."""
    if "_" in string:
        raise ValueError(f"{string!r} is not an integer")
    return int(string)


def number(string: str) -> float:
    """A positive number. Raises ValueError."""
    value = finite(string)
    if not value > 0:
        raise ValueError(f"{string!r} is not a finite number above 0")
    return value


def not_negative(string: str) -> float:
    """A number that is 0 or above. Raises ValueError."""
    value = finite(string)
    if not value >= 0:
        raise ValueError(f"{string!r} is not a finite number of at least 0")
    return value


def finite(string: str) -> float:
    """The number in the string, or NaN if there is none or it is not finite."""
    try:
        value = decimal(string)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def listed(string: str) -> tuple[str, ...]:
    """The names in a string, separated by commas, without repetitions."""
    return tuple(dict.fromkeys(filter(None, (part.strip() for part in string.split(",")))))


def add_parameter_options(parser: argparse.ArgumentParser, unit: str) -> None:
    """Options on the parameters of a run or a model."""
    parser.add_argument(
        "--set",
        action=Named,
        read=value,
        metavar="NAME=VALUE",
        help=f"start value in {unit} (default: the FMU's). May be repeated",
    )
    parser.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE",
        help="parameters in JSON, as `prw identify` writes; --set has precedence",
    )
    parser.set_defaults(options={"parameters": "--parameters"})


def parameters_of(arguments: argparse.Namespace) -> dict[str, Any]:
    """The values by name from --parameters and --set."""
    found: dict[str, Any] = {}
    if arguments.parameters is not None:
        with loaded(existing_fmu(arguments.fmu)) as inside:
            found = values_of(arguments.parameters, inside)
    if arguments.set:
        arguments.options = {"parameters": "--set"}
    return {**found, **arguments.set}


def value(string: str) -> float | bool:
    """A number, or `true` or `false`. Raises ValueError."""
    try:
        return string == "true" if string in ("true", "false") else decimal(string)
    except ValueError:
        raise ValueError(f"{string!r} is not a number") from None


def spread(string: str) -> float | tuple[float, float]:
    """Converts PERCENT% to a fraction, and VALUE:PERCENT% to (value, fraction). Raises ValueError."""
    match = re.fullmatch(r"(?:([^:]+):)?\s*([^:%]+)%", string)
    if not match:
        raise ValueError("write NAME=10%, or NAME=VALUE:10%")
    fraction = number(match[2]) / 100
    return (number(match[1]), fraction) if match[1] else fraction


def bounds(string: str) -> tuple[float, float]:
    """Converts LOW:HIGH to two positive numbers. Raises ValueError."""
    low, colon, high = string.partition(":")
    if not colon:
        raise ValueError("write NAME=LOW:HIGH")
    return number(low), number(high)
