"""Interrupts (Ctrl-C) of the command `prw`."""

from __future__ import annotations

import signal
import threading
from types import FrameType


def wait_for_imports() -> None:
    """Make an interrupt wait for the end of an import, because compiled modules, such as those of NumPy, may crash if an exception is
    raised while they are initialized."""
    # Interrupts may also be ignored, for example in a background job.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)


def _interrupt(number: int, frame: FrameType | None) -> None:
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            again = threading.Timer(0.02, signal.raise_signal, [number])
            again.daemon = True
            again.start()
            return
        frame = frame.f_back
    raise KeyboardInterrupt
