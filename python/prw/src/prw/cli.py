"""The command `prw`: runs the subcommand. An error that the user can fix is reported in one line on stderr."""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import signal
import sys
import threading
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from types import ModuleType
from typing import Any

from prw import progress
from prw.commands import check, excite, identify, linearize, simulate, sweep
from prw.commands.options import Formatter
from prw.errors import UserError, one_line

#: The subcommands by name. Each is a module with a docstring (the description), HELP (one line), run(arguments) and,
#: optionally, add_options(parser) and EXAMPLES.
_MODULES = (simulate, check, linearize, identify, excite, sweep)
COMMANDS = {module.__name__.rpartition(".")[2]: module for module in _MODULES}
#: The option that a message names instead of the argument of a UserError, if their names differ.
OPTIONS = {"parameters": "--set", "priors": "--prior", "skip": "--skip-lines"}


def main(argv: Sequence[str] | None = None) -> int:
    """Run `prw` with the arguments argv (default: the process's). Returns the exit status: 0, the `status` of a
    UserError (1, or 3 if the model does not explain the data), or 130 after an interrupt. For wrong options, `--help` and
    `--version`, argparse raises SystemExit."""
    return run("prw", "Simulate the pitch-roll wrist testbed through its FMU.", COMMANDS, argv)


def run(program: str, description: str, commands: Mapping[str, ModuleType], argv: Sequence[str] | None) -> int:
    """Run one of the commands as `program COMMAND ...`."""
    _open_streams()
    parser = argparse.ArgumentParser(prog=program, description=description)
    parser.add_argument("--version", action="version", version=f"{program} {version('prw')}")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, command in commands.items():
        examples, add_options = getattr(command, "EXAMPLES", None), getattr(command, "add_options", lambda _: None)
        strings = {"help": command.HELP, "description": command.__doc__, "epilog": examples}
        subparser = subparsers.add_parser(name, formatter_class=Formatter, **strings)
        add_options(subparser)
        subparser.set_defaults(run=command.run)
    arguments = argparse.Namespace(options={})
    before = _end_on_sigterm()
    try:
        _, unknown = parser.parse_known_args(argv, arguments)
        if unknown:
            parser.error(f"unrecognized arguments: {' '.join(unknown)}{_hint(unknown[0], argv, arguments)}")
        progress.show()
        arguments.run(arguments)
        sys.stdout.flush()
    except UserError as error:
        default = f"--{error.argument}" if hasattr(arguments, error.argument) else error.argument
        option = {**OPTIONS, **arguments.options}.get(error.argument, default)
        report(f"{program} {arguments.command}: {one_line(option)}{error.detail}")
        return error.status
    except KeyboardInterrupt as interrupt:
        what = f"; {interrupt}" if str(interrupt) else ""
        report(f"\n{program} {arguments.command}: interrupted{what}")
        return 130
    except OSError as error:
        # Errors of files are UserErrors, so this is the standard output. A write at exit would raise again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        # The reader may close the pipe: `prw ... | head`.
        if not isinstance(error, BrokenPipeError):
            report(f"{program} {arguments.command}: the output cannot be written ({error.strerror or error})")
            return 1
    finally:
        if before is not None:
            signal.signal(signal.SIGTERM, before)
    return 0


def _hint(unknown: str, argv: Sequence[str] | None, arguments: argparse.Namespace) -> str:
    """For an option like --k1 100: how to set a parameter."""
    given = list(sys.argv[1:] if argv is None else argv)
    name, _, value = unknown.partition("=")
    value = value or "".join(given[given.index(unknown) + 1 :][:1])
    if not hasattr(arguments, "parameters") or not re.fullmatch(r"--\w+", name) or not re.fullmatch(r"[\d.]\S*", value):
        return ""
    return f"; a parameter is set by --set {name.removeprefix('--')}={value}"


def report(message: str) -> None:
    """Print a message on the standard error, unless that cannot be written."""
    with contextlib.suppress(OSError):
        print(message, file=sys.stderr)


def _open_streams() -> None:
    """Replace closed standard streams (`prw ... >&-`) by the null device, so that no file gets their numbers."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115


def _end_on_sigterm() -> Any:
    """Make SIGTERM raise SystemExit, so that temporary files are removed. Returns the previous handler, or None if
    nothing was changed."""
    if threading.current_thread() is not threading.main_thread():
        return None
    if signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL:
        return None

    def end(number: int, _: Any) -> None:
        raise SystemExit(128 + number)

    return signal.signal(signal.SIGTERM, end)
