"""Exceptions with a message for the user."""

from __future__ import annotations

import importlib.util
import re
import sys
import unicodedata
from pathlib import Path
from typing import Any

#: Number of characters after which a message is cut.
LONGEST = 1000
#: Number of characters after which a value in a message is cut.
SHOWN = 200
#: The packages that `make study` installs in a clone.
STUDY = {"matplotlib", "scipy", "threadpoolctl", "jinja2", "pyarrow", "distributed"}


def one_line(text: str, longest: int = LONGEST) -> str:
    """The string; if it has more than `longest` characters, the rest becomes "...". Characters that a terminal would interpret
    or cannot show become escapes."""
    cut = text if len(text) <= longest else text[:longest] + "..."
    return "".join(c if c.isprintable() or unicodedata.category(c) == "Zs" else _escaped(c) for c in cut)


def _escaped(character: str) -> str:
    return character.encode("unicode_escape", "backslashreplace").decode("ascii")


def of_fmu(message: str) -> str:
    """A message of the FMU without names of C functions, and with the limits of positive parameters in usual words."""
    return re.sub(r"must not be below 1e-\d{3}\b", "must be above 0", re.sub(r"\bfmi[23]Set\w+: ", "", message))


class UserError(ValueError):
    """An error that the user can fix. The message is one line; `prw` exits with `status`.

    Parameters
    ----------
    message
        The cause and the remedy.
    argument
        The function's argument that is wrong; `prw` names the option for this argument instead.
    given
        The value of the argument.
    """

    status = 1

    def __init__(self, message: str, *, argument: str = "", given: Any = ""):
        self.argument = argument
        shown = one_line(f" {given}".rstrip(), SHOWN)
        self.detail = one_line(f"{shown}: {message}" if argument else message)
        super().__init__(argument + self.detail)


class MissingPackage(UserError, ImportError):
    """An optional package is not installed. Parameters as for `UserError`."""


class DoesNotFit(UserError):
    """The model does not explain the data with any parameters."""

    status = 3


class Interrupted(KeyboardInterrupt):
    """Ctrl-C has stopped a sweep.

    Parameters
    ----------
    message
        What is finished.
    table
        The table of the finished runs as in the result of the sweep, or None if there are none.
    """

    def __init__(self, message: str, table: Any):
        super().__init__(message)
        self.table = table


def need(*packages: str) -> None:
    """Raise MissingPackage unless the packages are installed."""
    missing = [name for name in packages if importlib.util.find_spec(name) is None]
    if missing:
        in_clone = (Path(sys.prefix).parent / "python/prw/pyproject.toml").is_file()
        command = "make study" if in_clone and {*missing} <= STUDY else f"pip install {' '.join(missing)}"
        raise MissingPackage(f"{', '.join(missing)} missing; install with: {command}")
