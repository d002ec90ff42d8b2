"""Progress of long work on stderr, in commands and interactive sessions."""

from __future__ import annotations

import sys
import time

QUIET_SECONDS = 2.0
TERMINAL_PERIOD = 0.2
LOG_PERIOD = 10.0


_wanted = False


def show() -> None:
    """Show progress in this process from now on. Commands call this."""
    global _wanted
    _wanted = True


def _is_wanted() -> bool:
    """Whether a command, a Python prompt or a notebook runs. Other programs get no output."""
    return _wanted or hasattr(sys, "ps1") or "ipykernel" in sys.modules


class Progress:
    """Reports the progress of a task that takes longer than two seconds, in commands and interactive sessions.

    On a terminal, one line is rewritten, and cleared at the end; in a log, a line is added every ten seconds.
    """

    def __init__(self, label: str, total: int):
        """`label` names the work; `total` is the number of its units (rows, bytes)."""
        self._label, self._total = label, max(total, 1)
        self._terminal = sys.stderr.isatty()
        self._next = time.monotonic() + QUIET_SECONDS
        self._shown = False

    def __enter__(self) -> Progress:
        return self

    def __call__(self, done: int) -> None:
        """Report that `done` units are done. This is fast enough to be called every thousand rows."""
        now = time.monotonic()
        if now < self._next or not _is_wanted():
            return
        self._next = now + (TERMINAL_PERIOD if self._terminal else LOG_PERIOD)
        self._shown = True
        text = f"{self._label} {min(done / self._total, 1):4.0%}"
        print(f"\r{text}" if self._terminal else text, end="" if self._terminal else "\n", file=sys.stderr, flush=True)

    def __exit__(self, *_: object) -> None:
        if self._shown and self._terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
