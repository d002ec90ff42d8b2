"""The command `prw`: finds the subcommand, and turns what the user can mend into one line on stderr."""

from __future__ import annotations

import argparse
import os
import sys
from typing import Optional, Sequence

from prw import closed_loop, documentation, excite, figures, identify, simulate, sweep
from prw.errors import UserError

#: Each subcommand is a module with add_parser(subparsers); the parser's default `run` takes the parsed arguments.
COMMANDS = (simulate, figures, documentation, closed_loop, identify, excite, sweep)


def main(argv: Optional[Sequence[str]] = None) -> int:
    """Run `prw` with the arguments argv (default: the process's). Returns the exit status: 0, 1 after a UserError, 130
    when interrupted."""
    parser = argparse.ArgumentParser(prog="prw", description="Simulate the pitch-roll wrist testbed through its FMU.")
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for command in COMMANDS:
        command.add_parser(subparsers)
    arguments = parser.parse_args(argv)
    try:
        arguments.run(arguments)
        sys.stdout.flush()
    except UserError as error:
        print(f"prw {arguments.command}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"\nprw {arguments.command}: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of our output has gone (`prw ... | head`); keep the interpreter from tripping over it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0
