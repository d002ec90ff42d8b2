"""Compares results of other tools with the reference experiments that are included in the FMU.

In the order of dependence: experiments (the expected results), result (reads the file of another tool), agreement (the
differences). `check` below combines them.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from prw.arguments import flag
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
    """Compare the result of another tool with a reference experiment.

    Parameters
    ----------
    result
        CSV, a .mat file as OpenModelica writes it, or one that MATLAB saved with `-v7` or earlier. Columns are
        found by name, with or without a component, as in `testbed.roll`; unknown columns are ignored. Units
        are part of the names (`roll [deg]`) or in `units`, otherwise they are SI.
    experiment
        Name of the experiment (default: the nearest one).
    model_exchange
        Apply the tolerances for Model Exchange instead of the tolerances for Co-Simulation.
    component
        The name before the dot, if columns of several components have the same name (default: `testbed`).
    units
        Unit by name, of columns whose names have none.
    fmu
        The FMU with the experiments (default: the testbed's).

    Returns
    -------
    Agreement
        The difference of each output. A result that does not agree raises no error.

    Raises
    ------
    UserError
        A file cannot be read, a name is not known, or the result has no output at any of the experiment's times.
    """
    # These imports are slow.
    from prw.checking.agreement import compare, nearest
    from prw.checking.experiments import find, read_experiments
    from prw.checking.result import read_result

    way = "ModelExchange" if flag("model_exchange", model_exchange) else "CoSimulation"
    known = read_experiments(existing_fmu(fmu))
    chosen = None if experiment is None else find(known, experiment)
    found = read_result(Path(result), units, component)
    return compare(found, chosen or nearest(found, known), way)
