"""Options of `prw identify` and `prw excite`: texts like k1=120 to numbers, with a clear word on what is wrong."""

from __future__ import annotations

import argparse
import importlib.util
import math
import re
from typing import Dict, Iterable, Mapping, Sequence, Tuple

from prw.errors import UserError

#: What is estimated if nothing is said.
DEFAULT_ESTIMATE = "k1,k2,c1,c2,c3"
#: Default bounds: this factor about the start value.
REACH = 100.0


class FORMATTER(argparse.RawDescriptionHelpFormatter):
    """Keeps the line breaks of descriptions and examples, at the house's width."""

    def __init__(self, prog: str):
        super().__init__(prog, max_help_position=30, width=110)


def add_task_options(parser: argparse.ArgumentParser) -> None:
    """Options on parameters and noise that identification and experiment design share."""
    parser.add_argument(
        "--estimate",
        default=DEFAULT_ESTIMATE,
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


def need(*packages: str) -> None:
    """Raise UserError unless the packages are installed."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        raise UserError(
            f"{', '.join(missing)} missing; `make study` installs what identification and sweeps need "
            "(or: pip install 'prw[study]')"
        )


def pairs(texts: Iterable[str], option: str) -> Dict[str, str]:
    """NAME=TEXT, each perhaps several with commas, as a dict. Raises UserError naming the option."""
    found: Dict[str, str] = {}
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


def names(text: str, known: Sequence[str], option: str, others: str = "") -> Tuple[str, ...]:
    """Names with commas, each once and known. `others` is said of those that are not."""
    found = tuple(dict.fromkeys(filter(None, (part.strip() for part in text.split(",")))))
    for name in found:
        if name not in known:
            raise UserError(f"{option}: {name} is not known; there are {', '.join(known)}{others}")
    if not found:
        raise UserError(f"{option}: nothing is named; there are {', '.join(known)}")
    return found


def numbers(texts: Iterable[str], known: Sequence[str], option: str) -> Dict[str, float]:
    """NAME=VALUE with known names and positive values."""
    found = pairs(texts, option)
    names(",".join(found) or known[0], known, option)
    return {name: number(text, f"{option} {name}") for name, text in found.items()}


def spreads(texts: Iterable[str], starts: Mapping[str, float], option: str) -> Dict[str, Tuple[float, float]]:
    """NAME=[VALUE:]PERCENT% as (value, fraction) by name; the value is the start value if none is given."""
    found = {}
    for name, text in pairs(texts, option).items():
        names(name, list(starts), option)
        match = re.fullmatch(r"(?:([^:]+):)?\s*([^:%]+)%", text)
        if not match:
            raise UserError(f"{option} {name}={text}: write {name}=10%, or {name}=VALUE:10%")
        value = number(match.group(1), f"{option} {name}") if match.group(1) else starts[name]
        found[name] = (value, number(match.group(2), f"{option} {name}") / 100)
    return found


def bounds(texts: Iterable[str], starts: Mapping[str, float]) -> Dict[str, Tuple[float, float]]:
    """NAME=LOW:HIGH over the default bounds, by name."""
    found = {name: (value / REACH, value * REACH) for name, value in starts.items()}
    for name, text in pairs(texts, "--bounds").items():
        names(name, list(starts), "--bounds")
        low, colon, high = text.partition(":")
        if not colon:
            raise UserError(f"--bounds {name}={text}: write {name}=LOW:HIGH")
        found[name] = (number(low, f"--bounds {name}"), number(high, f"--bounds {name}"))
        if found[name][0] >= found[name][1]:
            raise UserError(f"--bounds {name}={text}: the first must be below the second")
    return found
