"""Systems of connected FMUs."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from fmu_run._native import Loaded
from fmu_run.fmu import Fmu
from fmu_run.model import Model


class System(Model):
    """Connected FMUs that run as one FMU.

    Variables are named `component.variable`. The connectors of an SSP's outer system keep their names. During a communication step, all
    components keep the values that their inputs had at the start of the step.

    Parameters
    ----------
    source
        Path of an SSP file or of a directory with an unpacked one, or a dict of the components by name. Components are FMUs with
        Co-Simulation, as open `Fmu` objects or as paths. An FMU may occur more than once.
    connections
        Connections from outputs to inputs, `{"law.u": "plant.u"}`, or as pairs. If an output is connected to several inputs, their names
        are a list. Not allowed with an SSP file, which contains its connections.
    order
        The order of data exchange. With "dependencies", every output is read at each communication point, after the inputs on which it
        depends directly have been set; an algebraic loop is a ValueError, which names the loop. With "jacobi", all outputs are read at
        the end of a step and all inputs are set at the start of the next step, as in FMPy and libcosim, so outputs that depend directly
        on inputs lag by one step.

    Raises
    ------
    ValueError
        For invalid arguments, invalid connections, and start values in an SSP file that do not fit its variables.
    FmuError
        If the file is not an SSP or has unsupported content, or if an FMU cannot be loaded or does not support Co-Simulation.

    Warns
    -----
    UserWarning
        For each value of an SSP file that is not converted, because its unit or the unit of its variable is not defined, and for each that
        is not used, because it has no variable.
    """

    def __init__(
        self,
        source: str | os.PathLike[str] | Mapping[str, Fmu | str | os.PathLike[str]],
        connections: Mapping[str, str | Sequence[str]] | Iterable[tuple[str, str | Sequence[str]]] | None = None,
        *,
        order: Literal["dependencies", "jacobi"] = "dependencies",
    ):
        if isinstance(source, Mapping):
            fmus = [(name, _component(name, fmu)._loaded) for name, fmu in source.items()]
            super().__init__(Loaded.connected("system", fmus, _pairs(connections), order))
        elif not isinstance(source, str | os.PathLike):
            raise ValueError(f"source must be the path of an SSP or a dict of FMUs by name, it is {source!r}")
        elif connections is not None:
            raise ValueError("an SSP has its own connections; give connections with FMUs only")
        else:
            super().__init__(Loaded.ssp(source, order))
        name, stages, stop_time, strange = self._loaded.about_system()
        for why in strange:
            warnings.warn(why, UserWarning, stacklevel=2)
        #: str: name of the system.
        self.name = name
        #: list[list[tuple[str, str]]]: connections (output, input) in the stages in which values are passed at a communication point.
        self.stages = stages
        #: float | None: stop time of the SSP's default experiment, s.
        self.stop_time = stop_time

    def __repr__(self) -> str:
        connections = sum(map(len, self.stages))
        return f"<System {self.name}, {connections} connections, {len(self.variables)} variables>"


def _component(name: str, fmu: Fmu | str | os.PathLike[str]) -> Fmu:
    if not isinstance(name, str):
        raise ValueError(f"the names in source must be str, one is {name!r}")
    if not isinstance(fmu, Fmu | str | os.PathLike):
        raise ValueError(f"source: {name} must be an Fmu or a path, it is {fmu!r}")
    return fmu if isinstance(fmu, Fmu) else Fmu(fmu)


def _pairs(
    connections: Mapping[str, str | Sequence[str]] | Iterable[tuple[str, str | Sequence[str]]] | None,
) -> list[tuple[str, str]]:
    """Return the connections as pairs of one output and one input."""
    try:
        given = connections.items() if isinstance(connections, Mapping) else () if connections is None else connections
        found = [(output, to) for output, ends in given for to in ([ends] if isinstance(ends, str) else ends)]
    except (TypeError, ValueError):
        found = [("", None)]  # Rejected below.
    for output, to in found:
        if not isinstance(output, str) or not isinstance(to, str):
            raise ValueError(
                f"connections must be a dict of outputs and their inputs, both str, or pairs of them, they are {connections!r}"
            )
    return found
