"""The pitch-roll wrist testbed in Python: simulate it, read recordings of it, find its parameters in them, linearize it,
run it with thousands of parameter sets, show it moving, compare what other tools make of it with a reference.

    import prw

    run = prw.simulate("motors.csv", {"k1": 100.0})  # or a prw.Motion; by default the paper's experiment
    run["roll"]  # (n,) rad, at run.time

Everything is in SI (s, rad, rad/s, N.m, kg.m2). Nothing prints, and nothing writes a file unless it is told where. What
the caller can put right is a `prw.UserError`, whose text says what is wrong and what to do.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from prw.animation import animate
    from prw.checking import check
    from prw.checking.agreement import Agreement
    from prw.errors import UserError
    from prw.identification import identify
    from prw.identification.excitation import Excitation, excite
    from prw.identification.results import Identification
    from prw.linearization import Linearizer, linearize
    from prw.motion import Motion
    from prw.recording import Recording, read
    from prw.simulation import Run, simulate
    from prw.state_space import StateSpace
    from prw.sweeps import sweep

__all__ = [
    "Agreement",
    "Excitation",
    "Identification",
    "Linearizer",
    "Motion",
    "Recording",
    "Run",
    "StateSpace",
    "UserError",
    "animate",
    "check",
    "excite",
    "identify",
    "linearize",
    "read",
    "simulate",
    "sweep",
]

#: The module of each name, loaded when the name is first used, so that `import prw` takes no time. No module or package
#: in this folder may be called like a name here (as `identify` is): once imported, it would be in the name's place.
_HOMES = {
    "Agreement": "checking.agreement",
    "Excitation": "identification.excitation",
    "Identification": "identification.results",
    "Linearizer": "linearization",
    "Motion": "motion",
    "Recording": "recording",
    "Run": "simulation",
    "StateSpace": "state_space",
    "UserError": "errors",
    "animate": "animation",
    "check": "checking",
    "excite": "identification.excitation",
    "identify": "identification",
    "linearize": "linearization",
    "read": "recording",
    "simulate": "simulation",
    "sweep": "sweeps",
}


def __getattr__(name: str) -> Any:
    if name == "motion":  # for prw.motion.fig4()
        return importlib.import_module("prw.motion")
    if name not in _HOMES:
        raise AttributeError(f"module 'prw' has no attribute {name!r}")
    value = globals()[name] = getattr(importlib.import_module(f"prw.{_HOMES[name]}"), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
