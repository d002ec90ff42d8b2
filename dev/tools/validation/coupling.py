"""The error of coupling at communication points by Jacobi's method, with and without input derivatives, for several
step sizes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Any, NamedTuple

import fmpy
import numpy as np
from fmu_run import Fmu, Instances

from tools.validation.system import System

#: Communication steps (s), and the step of the reference solution; the former are integer multiples of the latter.
STEPS = (125e-6, 250e-6, 500e-6, 1e-3, 2e-3, 4e-3, 8e-3, 16e-3)
FINEST = 31.25e-6
DURATION = 0.96


class Study(NamedTuple):
    """Largest errors of pitch and roll at common communication points, for k step sizes.

    Attributes
    ----------
    step
        (k,) s.
    held
        (k,) deg, if inputs are held over a step.
    derivatives
        (k,) deg, if inputs are extrapolated with fmi2SetRealInputDerivatives of order 1.
    """

    step: np.ndarray
    held: np.ndarray
    derivatives: np.ndarray

    def columns(self) -> dict[str, np.ndarray]:
        """The columns of a table."""
        return {"step": self.step, "error_held_deg": self.held, "error_with_derivatives_deg": self.derivatives}


def study(system: System) -> Study | None:
    """Couple the FMUs of the system with STEPS, and compare with steps of FINEST.

    Returns None unless every FMU supports input and output derivatives.
    """
    for fmu in system.fmus.values():
        offer = fmpy.read_model_description(str(system.osp / fmu)).coSimulation
        if not offer.canInterpolateInputs or not offer.maxOutputDerivativeOrder:
            return None
    exact = couple(system, FINEST, DURATION, derivatives=True)

    def error(step: float, derivatives: bool) -> float:
        found = couple(system, step, DURATION, derivatives)
        return float(np.rad2deg(np.abs(found - exact[:: round(step / FINEST)]).max()))

    held, extrapolated = ([error(step, derivatives) for step in STEPS] for derivatives in (False, True))
    return Study(np.array(STEPS), np.array(held), np.array(extrapolated))


def couple(
    system: System,
    step: float,
    duration: float,
    derivatives: bool,
    outputs: Sequence[str] = ("testbed.pitch", "testbed.roll"),
) -> np.ndarray:
    """Couple the FMUs by Jacobi's method. Returns the outputs at every communication point from 0 on, (n + 1, outputs).

    With `derivatives` each input also gets the time derivative that its output has at the communication point.
    """
    n = round(duration / step)
    with ExitStack() as stack:
        values = {**system.start, **dict(system.inputs.values())}
        instances: dict[str, Instances] = {}
        for name, fmu in system.fmus.items():
            start = {key.split(".")[1]: value for key, value in values.items() if key.split(".")[0] == name}
            instances[name] = stack.enter_context(Fmu(system.osp / fmu)).instances(start=start)
        connections = _connections(system, instances)
        watched = [(instances[name.split(".")[0]], name.split(".")[1]) for name in outputs]
        rows = np.empty((n + 1, len(outputs)))
        for k, row in enumerate(rows):
            row[:] = [instance.get(variable)[0] for instance, variable in watched]
            if k < n:
                # All outputs are read before any input is set, because an input may change outputs.
                for source, variables, _, _, read, slopes in connections:
                    source.get(variables, read)
                    if derivatives:
                        source.get_output_derivatives(variables, slopes)
                for _, _, inputs, target, read, slopes in connections:
                    target.set(inputs, read)
                    if derivatives:
                        target.set_input_derivatives(inputs, slopes)
                for instance in instances.values():
                    instance.step(step)
    return rows


def _connections(system: System, instances: Mapping[str, Instances]) -> list[Any]:
    """For each pair of connected FMUs: the source and its outputs, the target and its inputs, and two rows of memory."""
    pairs: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for output, input_ in system.connections:
        (source, output), (target, input_) = output.split("."), input_.split(".")
        pairs.setdefault((source, target), []).append((output, input_))
    return [
        (instances[source], *zip(*names), instances[target], np.empty((1, len(names))), np.empty((1, len(names))))
        for (source, target), names in pairs.items()
    ]
