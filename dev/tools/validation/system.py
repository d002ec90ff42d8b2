"""The closed loop in the files of `build_closed_loop`: FMUs, connections and start values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from prw.errors import UserError

Value = float | int | bool
OSP = "{http://opensimulationplatform.com/MSMI/OSPSystemStructure}"


@dataclass(frozen=True)
class System:
    """The closed loop. Variables are written `component.variable`.

    Attributes
    ----------
    ssp
        The SSP file.
    osp
        The directory with OspSystemStructure.xml.
    fmus
        File name by component.
    connections
        Pairs of an output and an input.
    start
        Start values by variable.
    inputs
        Target and value by input of the system.
    stop_time, step
        s.
    """

    ssp: Path
    osp: Path
    fmus: Mapping[str, str]
    connections: Sequence[tuple[str, str]]
    start: Mapping[str, Value]
    inputs: Mapping[str, tuple[str, float]]
    stop_time: float
    step: float

    @property
    def steps(self) -> int:
        """Communication steps of the experiment."""
        return round(self.stop_time / self.step)


def read(ssp: Path, osp: Path) -> System:
    """Read the SSP, and the step size and the stop time from OspSystemStructure.xml. Raises UserError."""
    from fmpy.ssp import ssd

    for path in (ssp, osp / "OspSystemStructure.xml"):
        if not path.is_file():
            raise UserError(f"{path}: no such file; `make closed-loop` builds it")
    try:
        system = ssd.read_ssd(str(ssp)).system
        root = ElementTree.parse(osp / "OspSystemStructure.xml").getroot()
        stop_time, step = (float(root.findtext(OSP + name) or "") for name in ("EndTime", "BaseStepSize"))
    except Exception as error:  # FMPy raises bare Exceptions
        raise UserError(f"{ssp}: cannot be read ({str(error).splitlines()[0]})") from None
    values = dict(_values(system))
    connections, inputs = [], {}
    for connection in system.connections:
        if connection.startElement is None:
            inputs[connection.startConnector] = (
                f"{connection.endElement}.{connection.endConnector}",
                float(values[connection.startConnector]),
            )
        elif connection.endElement is not None:
            connections.append(
                (
                    f"{connection.startElement}.{connection.startConnector}",
                    f"{connection.endElement}.{connection.endConnector}",
                )
            )
    start: dict[str, Value] = {}
    for component in system.elements:
        start.update({f"{component.name}.{name}": value for name, value in _values(component)})
    fmus = {component.name: Path(component.source).name for component in system.elements}
    return System(ssp, osp, fmus, connections, start, inputs, stop_time, step)


def _values(element: Any) -> Iterator[tuple[str, Value]]:
    """The start values bound to a system or component, by name."""
    for binding in element.parameterBindings:
        for parameter_set in binding.parameterValues:
            for parameter in parameter_set.parameters:
                if parameter.type == "Real":
                    yield parameter.name, float(parameter.value)
                elif parameter.type == "Boolean":
                    yield parameter.name, parameter.value in ("true", "1")
                else:
                    yield parameter.name, int(parameter.value)
