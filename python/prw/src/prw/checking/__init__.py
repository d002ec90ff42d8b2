"""Whether what another tool wrote agrees with the reference experiments that travel in the FMU.

In the order in which the files build on each other: experiments (what should come out), result (what another tool
wrote), agreement (how far one is from the other). `check` below puts them together.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from prw.testbed import existing_fmu

if TYPE_CHECKING:
    from prw.checking.agreement import Agreement


def check(
    result: str | os.PathLike[str],
    experiment: str | None = None,
    *,
    model_exchange: bool = False,
    component: str | None = None,
    units: Mapping[str, str] = {},
    fmu: str | os.PathLike[str] | None = None,
) -> Agreement:
    """Compare what another tool wrote with a reference experiment.

    Parameters
    ----------
    result
        CSV, a .mat file as OpenModelica writes it, or one that MATLAB saved with `-v7` or earlier. Its columns are
        found by name, also behind that of a component, as in `testbed.roll`; what is not known is left out. Units
        stand in the names (`roll [deg]`) or in `units`, otherwise they are SI.
    experiment
        Its name (default: the one that is nearest).
    model_exchange
        Judge by the tolerances for that interface type instead of those for Co-Simulation.
    component
        The name before the dot, where several have columns of the same name (default: `testbed`).
    units
        Unit by name.
    fmu
        The one whose experiments are taken (default: the testbed's).

    Returns
    -------
    Agreement
        How far each output is off. A result that does not agree is no error.

    Raises
    ------
    UserError
        A file cannot be read, a name is not known, or the result has no output at any of the experiment's times.
    """
    # They take a while to load.
    from prw.checking.agreement import compare, nearest
    from prw.checking.experiments import find, read_experiments
    from prw.checking.result import read_result

    known = read_experiments(existing_fmu(fmu))
    chosen = None if experiment is None else find(known, experiment)
    found = read_result(Path(result), units, component)
    return compare(found, chosen or nearest(found, known), "ModelExchange" if model_exchange else "CoSimulation")
