"""The FMU's linear model between samples, and its response to the spectra of a recording.

Between two samples the motors follow the cubic that has their angles and rates at both; over such a step eq. (11) is
solved exactly by one matrix exponential. Summed over a recording of n samples, x[k+1] = Ad x[k] + G0 u[k] + G1 u[k+1]
becomes z X = Ad X + (G0 + z G1) U + z d with z = exp(2 pi i f h) and d = x[0] - x[n]. So an experiment that
starts and ends in any state differs from a periodic one by six numbers (Pintelon and Schoukens, System Identification: A Frequency
Domain Approach, 2nd ed., Sec. 6.3.2).

A recording that the FMU simulated in Co-Simulation is compared with the FMU's own steps. During a step, each angle
follows its rate, and at the start of the next step the states jump in proportion to the difference between the angle
and this extrapolation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from prw.columns import CHANNELS
from prw.identification.experiment import Experiment
from prw.identification.kinds import FILTERS, KINDS, LINEAR
from prw.motion import Array
from prw.state_space import Complex, StateSpace

#: Bounds of a distortion in units of its scale.
FURTHEST = 50.0


class Distortion(NamedTuple):
    """What distinguishes a rig or its record from the FMU: a kind of KINDS at a place."""

    kind: str
    channel: str

    def __str__(self) -> str:
        return KINDS[self.kind].places.get(self.channel) or f"{self.kind} of {self.channel}"

    def value(self, x: float) -> float:
        """The size in SI from the unknown x."""
        return float(np.exp(x)) if self.kind == "gain" else x * KINDS[self.kind].scale

    def response(self, x: float, s: Complex) -> tuple[Complex, Complex]:
        """Frequency response (f,) of a filter, and the derivative of its logarithm with respect to x."""
        if self.kind == "gain":
            return np.full(len(s), np.exp(x) + 0j), np.ones(len(s), dtype=complex)
        s = s * KINDS[self.kind].scale
        if self.kind == "delay":
            return np.exp(-s * x), -s
        return 1 / (1 + s * x), -s / (1 + s * x)


class Discrete(NamedTuple):
    """A model over one step: x[k+1] = A x[k] + before u[k] + after u[k+1], y[k] = C x[k] + D u[k].

    A is (..., 6, 6), before and after (..., 6, m), C (..., c, 6), D (..., c, m), with m = 4 inputs, or 6 with jumps.
    """

    A: Array
    before: Array
    after: Array
    C: Array
    D: Array

    def slopes(self, step: float) -> Discrete:
        """Derivatives with respect to p parameters, from models at p steps forwards and p steps backwards."""
        half = len(self.A) // 2
        return Discrete(*((block[:half] - block[half:]) / (2 * step) for block in self))


def discrete(models: Sequence[StateSpace], step: float, channels: tuple[str, ...], simulated: bool) -> Discrete:
    """Discretize m models for the outputs `channels` and steps of `step` s. simulated: whether the motors move as in a
    simulation of the FMU in Co-Simulation, instead of along cubics."""
    rows = [CHANNELS.index(name) for name in channels]
    A, B, C, D = (np.stack([getattr(model, block) for model in models]) for block in "ABCD")
    angle, rate, C, D = B[..., :2], B[..., 2:], C[..., rows, :], D[..., rows, :]
    # The state, and the motors' angles with three derivatives, in units of the step.
    whole = np.zeros((len(models), 14, 14))
    whole[..., :6, :6], whole[..., :6, 6:8], whole[..., :6, 8:10] = A * step, angle * step, rate
    whole[..., 6:12, 8:14] = np.eye(6)
    solved = expm(whole)[..., :6, :]
    e0, e1, e2, e3 = (solved[..., 6 + 2 * i : 8 + 2 * i] for i in range(4))
    if simulated:
        before = np.concatenate([e0, step * e1, solved[..., :6] @ rate], axis=-1)
        direct = np.concatenate([D, np.zeros((*D.shape[:-1], 2))], axis=-1)
        return Discrete(solved[..., :6], before, np.zeros_like(before), C, direct)
    before = np.concatenate([e0 - 6 * e2 + 12 * e3, step * (e1 - 4 * e2 + 6 * e3)], axis=-1)
    after = np.concatenate([6 * e2 - 12 * e3, step * (6 * e3 - 2 * e2)], axis=-1)
    return Discrete(solved[..., :6], before, after, C, D)


class Response:
    """Response of a model to the motors of an experiment, at its first `bins` frequencies (f)."""

    def __init__(
        self,
        model: Discrete,
        experiment: Experiment,
        bins: int,
        distortions: Mapping[Distortion, float],
        effects: Mapping[Distortion, Complex] = {},
        constant: Complex | None = None,
    ):
        """distortions: the unknown of each; channels that the experiment does not contain are ignored. effects: spectra (f, c) that
        are added to the outputs per unit of a distortion's size, and `constant` regardless of the sizes, see `effects`."""
        self.model = model
        turn = 2j * np.pi * np.arange(bins) / len(experiment.time)
        self._z, self._s = np.exp(turn)[:, None, None], (turn / experiment.step).astype(np.complex128)
        # The motors' motion, and a unit error of each angle with the error of its rate.
        motors = experiment.motors[:bins]
        self._motors = np.zeros((*motors.shape, 3), dtype=complex)
        self._motors[..., 0] = motors
        self._motors[:, [0, 1], [1, 2]], self._motors[:, [2, 3], [1, 2]] = 1, self._s[:, None]
        if experiment.jumps is not None:
            self._motors[:, [4, 5], [1, 2]] = 1 - (1 + self._s[:, None] * experiment.step) / self._z[..., 0]
        self._resolvent = np.linalg.inv(self._z * np.eye(6) - model.A)
        self._states = self._resolvent @ ((model.before + self._z * model.after) @ self._motors)
        from_motors: Complex = model.C @ self._states + model.D @ self._motors
        #: Spectra of the channels (f, c) without transients.
        self.outputs: Complex = from_motors[..., 0]
        #: Transfer from the motors' angles, whose rates follow, to the channels: (f, c, 2).
        self.transfer: Complex = from_motors[..., 1:]
        #: Contribution of each of the six numbers d, (f, c, 6).
        self.transients: Complex = self._z * (model.C @ self._resolvent)
        self._filters = np.ones((bins, model.C.shape[0]), dtype=complex)
        self._linear = [k for k, distortion in enumerate(distortions) if distortion.kind in LINEAR]
        self._growths = np.zeros((len(distortions), bins, model.C.shape[0]), dtype=complex)
        for k, (distortion, x) in enumerate(distortions.items()):
            if distortion.kind in FILTERS and distortion.channel in experiment.channels:
                channel = experiment.channels.index(distortion.channel)
                through, self._growths[k, :, channel] = distortion.response(x, self._s)
                self._filters[:, channel] *= through
        self._added: Complex = np.zeros((len(distortions), *self.outputs.shape), dtype=complex)
        for k, distortion in enumerate(distortions):
            if distortion in effects:
                self._added[k] = KINDS[distortion.kind].scale * effects[distortion][:bins]
        self.outputs *= self._filters
        self.outputs += np.tensordot(list(distortions.values()), self._added, 1) if distortions else 0.0
        self.outputs += 0.0 if constant is None else constant[:bins]
        self.transients *= self._filters[..., None]
        self.transfer *= self._filters[..., None]

    def moving(self, d: Array) -> Complex:
        """Spectra of the states (f, 6) with transients `d` (6,)."""
        return self._with(d)[..., 0]

    def driven(self, increments: Complex, direct: Complex) -> Complex:
        """Spectra of the channels (f, c) for increments of the states in every step, and direct changes of the channels, whose spectra
        are (all_bins, 6) and (all_bins, c)."""
        bins = len(self._states)
        moved = self.model.C @ (self._resolvent @ increments[:bins, :, None])
        driven: Complex = self._filters * (moved[..., 0] + direct[:bins])
        return driven

    def _with(self, d: Array) -> Complex:
        """The states, with transients `d` (6,) for the motors' motion."""
        states: Complex = self._states.copy()
        states[..., 0] += (self._z * self._resolvent) @ d
        return states

    def slopes(self, change: Discrete, d: Array) -> tuple[Complex, Complex]:
        """Derivatives with respect to the p unknowns, which are parameters and then distortions, of outputs with transients `d` (6,):
        (p, f, c), and of transfer: (p, f, c, 2).

        change: the model's derivatives with respect to the unknowns that change it, in the same order."""
        count, bins = len(change.A), len(self._states)

        def moved_by(block: Array, table: Complex) -> Complex:
            """`block` (p, r, q) times `table` (f, q, 3): (f, 3, p, r), as one product of two large matrices."""
            product: Complex = np.tensordot(table, block, (1, 2))
            return product

        states = self._with(d)
        driven = moved_by(change.A, states) + moved_by(change.before, self._motors)
        driven += moved_by(change.after, self._z * self._motors)
        moved = driven.reshape(bins, 3 * count, 6) @ self._resolvent.swapaxes(-1, -2) @ self.model.C.T
        table = moved.reshape(bins, 3, count, -1) + moved_by(change.C, states) + moved_by(change.D, self._motors)
        table = (table * self._filters[:, None, None]).transpose(2, 0, 3, 1)
        there: Complex = self.outputs + self.transients @ d
        parameters = count - len(self._linear)

        def placed(modelled: Complex, others: Complex) -> Complex:
            """All unknowns: parameters, and distortions, some of which change the model."""
            found = np.concatenate([modelled[:parameters], others])
            found[[parameters + k for k in self._linear]] += modelled[parameters:]
            return found

        more = self._growths[..., None] * self.transfer
        return placed(table[..., 0], self._growths * there + self._added), placed(table[..., 1:], more)
