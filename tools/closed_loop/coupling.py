"""What coupling at communication points costs: Jacobi's method with and without input derivatives, over the step
size."""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Sequence
from contextlib import ExitStack
from ctypes import c_double, c_int, c_uint32
from pathlib import Path
from typing import NamedTuple

import fmpy
import numpy as np

from prw.instance import Instance
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
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        with zipfile.ZipFile(system.ssp) as archive:
            archive.extractall(folder)
        values = {**system.start, **dict(system.inputs.values())}
        instances = {}
        for name, fmu in system.fmus.items():
            start = {key.split(".")[1]: value for key, value in values.items() if key.split(".")[0] == name}
            instances[name] = stack.enter_context(Instance(Path(folder, "resources", fmu), start))
        wires = [_Wire(instances, [w for w in system.connections if _ends(w) == ends]) for ends in _pairs(system)]
        watched = [(instances[name.split(".")[0]], name.split(".")[1]) for name in outputs]
        rows = np.empty((n + 1, len(outputs)))
        for k, row in enumerate(rows):
            row[:] = [instance.get(variable)[0] for instance, variable in watched]
            if k < n:
                # All outputs before any input: setting one must not change what another reads.
                for wire in wires:
                    wire.read(derivatives)
                for wire in wires:
                    wire.write(derivatives)
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


class _Wire:
    """All connections from one FMU to another, with arrays that are made once: a study has a hundred thousand steps."""

    def __init__(self, instances: dict[str, Instance], wires: list[tuple[str, str]]):
        (self._from, self._to), n = (instances[end] for end in _ends(wires[0])), len(wires)
        self._sources = (c_uint32 * n)(*(self._from.reference(start.split(".")[1]) for start, _ in wires))
        self._targets = (c_uint32 * n)(*(self._to.reference(end.split(".")[1]) for _, end in wires))
        self._values, self._slopes, self._orders, self._n = (c_double * n)(), (c_double * n)(), (c_int * n)(*[1] * n), n

    def read(self, derivatives: bool) -> None:
        fmu, n = self._from.fmu, self._n
        fmu.fmi2GetReal(fmu.component, self._sources, n, self._values)
        if derivatives:
            fmu.fmi2GetRealOutputDerivatives(fmu.component, self._sources, n, self._orders, self._slopes)

    def write(self, derivatives: bool) -> None:
        fmu, n = self._to.fmu, self._n
        fmu.fmi2SetReal(fmu.component, self._targets, n, self._values)
        if derivatives:
            fmu.fmi2SetRealInputDerivatives(fmu.component, self._targets, n, self._orders, self._slopes)
