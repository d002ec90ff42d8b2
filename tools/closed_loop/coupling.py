"""What coupling at communication points costs: Jacobi's method with and without input derivatives, over the step
size."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any, NamedTuple

import fmpy
import numpy as np
from fmu_run import Fmu, Instances

from tools.closed_loop.system import System

#: Communication steps (s) and the one that stands for the exact solution; all are whole multiples of it.
STEPS = (125e-6, 250e-6, 500e-6, 1e-3, 2e-3, 4e-3, 8e-3, 16e-3)
FINEST = 31.25e-6
DURATION = 0.96


class Study(NamedTuple):
    """step: (k,) s; the largest error of pitch and roll at common communication points, (k,) deg each: inputs held
    over a step (`held`), and extrapolated with fmi2SetRealInputDerivatives of order 1 (`derivatives`)."""

    step: np.ndarray
    held: np.ndarray
    derivatives: np.ndarray

    def columns(self) -> dict[str, np.ndarray]:
        """For a table."""
        return {"step": self.step, "error_held_deg": self.held, "error_with_derivatives_deg": self.derivatives}


def study(system: System, steps: Sequence[float] = STEPS) -> Study | None:
    """Couple the FMUs of the system at the given steps, and compare with steps of FINEST.

    None if not every FMU takes and gives derivatives.
    """
    for fmu in system.fmus.values():
        offer = fmpy.read_model_description(str(system.osp / fmu)).coSimulation
        if not offer.canInterpolateInputs or not offer.maxOutputDerivativeOrder:
            return None
    exact = couple(system, FINEST, DURATION, derivatives=True)

    def error(step: float, derivatives: bool) -> float:
        found = couple(system, step, DURATION, derivatives)
        return float(np.rad2deg(np.abs(found - exact[:: round(step / FINEST)]).max()))

    held, extrapolated = ([error(step, derivatives) for step in steps] for derivatives in (False, True))
    return Study(np.array(steps), np.array(held), np.array(extrapolated))


def couple(
    system: System,
    step: float,
    duration: float,
    derivatives: bool,
    outputs: Sequence[str] = ("testbed.pitch", "testbed.roll"),
) -> np.ndarray:
    """A master by Jacobi's method. Returns the outputs at every communication point from 0 on, (n + 1, outputs).

    With `derivatives` each input also gets the time derivative that its output has at the communication point.
    """
    n = round(duration / step)
    with ExitStack() as stack:
        values = {**system.start, **dict(system.inputs.values())}
        instances: dict[str, Instances] = {}
        for name, fmu in system.fmus.items():
            start = {key.split(".")[1]: value for key, value in values.items() if key.split(".")[0] == name}
            instances[name] = stack.enter_context(Fmu(system.osp / fmu)).instances(start=start)
        wires = [_wire(instances, [w for w in system.connections if _ends(w) == ends]) for ends in _pairs(system)]
        watched = [(instances[name.split(".")[0]], name.split(".")[1]) for name in outputs]
        rows = np.empty((n + 1, len(outputs)))
        for k, row in enumerate(rows):
            row[:] = [instance.get(variable)[0] for instance, variable in watched]
            if k < n:
                # All outputs before any input: setting one must not change what another reads.
                for source, variables, _, _, read, slopes in wires:
                    source.get(variables, read)
                    if derivatives:
                        source.get_output_derivatives(variables, slopes)
                for _, _, target, inputs, read, slopes in wires:
                    target.set(inputs, read)
                    if derivatives:
                        target.set_input_derivatives(inputs, slopes)
                for instance in instances.values():
                    instance.step(step)
    return rows


def _ends(wire: tuple[str, str]) -> list[str]:
    return [end.split(".")[0] for end in wire]


def _pairs(system: System) -> list[list[str]]:
    pairs = []
    for wire in system.connections:
        if _ends(wire) not in pairs:
            pairs.append(_ends(wire))
    return pairs


def _wire(instances: dict[str, Instances], wires: list[tuple[str, str]]) -> Any:
    """All connections from one FMU to another: the source and its outputs, the target and its inputs, and two rows."""
    source, target = (instances[end] for end in _ends(wires[0]))
    outputs, inputs = (tuple(wire[end].split(".")[1] for wire in wires) for end in (0, 1))
    return source, outputs, target, inputs, np.empty((1, len(wires))), np.empty((1, len(wires)))
