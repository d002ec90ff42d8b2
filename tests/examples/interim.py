"""The part of the interface `prw.simulate`, `prw.linearize`, `prw.Motion` that the examples use, where prw lacks it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import prw

FMU = Path("target/fmu/prw_testbed.fmu")


class _Run(dict):  # type: ignore[type-arg]
    """Courses by name, and their time."""

    time: Any


def install() -> None:
    """Give prw what it lacks."""
    if hasattr(prw, "Motion"):
        return
    from prw import motion
    from prw.linearize import linearize
    from prw.testbed import OUTPUTS, Testbed

    def simulate(motion: Any, parameters: Any = None, *, fmu: Any = None, outputs: Any = OUTPUTS) -> _Run:
        with Testbed(Path(fmu or FMU)) as testbed:
            run = _Run(testbed.respond(motion, outputs, parameters or {}))
        run.time, run.motion = motion.time, motion  # type: ignore[attr-defined]
        return run

    interface = SimpleNamespace(
        simulate=simulate,
        linearize=lambda fmu=None, parameters=None: linearize(Path(fmu or FMU), start_values=parameters),
        Motion=lambda time, theta, omega=None: motion.Motion("motion", time, theta, omega),
    )
    for name, value in vars(interface).items():
        setattr(prw, name, value)


def waiting() -> tuple[str, ...]:
    """The examples that prw cannot run yet."""
    return () if callable(getattr(prw, "identify", None)) else ("identify",)
