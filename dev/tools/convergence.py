"""The error of the FMU in Co-Simulation as a function of the step size, if angles are set, if rates are set as well,
and for piecewise linear motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from prw.columns import CHANNELS
from prw.motion import Array, Motion
from prw.state_space import StateSpace
from prw.testbed import Testbed

#: The motion: theta_i = AMPLITUDE_i sin(RATE_i t + PHASE_i), rad, with frequencies of 2.2 and 3.7 Hz. (RATE is in rad/s.)
AMPLITUDE, RATE, PHASE = np.array([0.3, 0.2]), np.array([14.0, 23.0]), np.array([0.4, 1.9])
#: Duration, s.
DURATION = 1.0
#: Time, s, from which errors count. Before, an error remains from the first two steps, in which the rates are unknown
#: if only angles are set.
FROM = 0.3
STEPS_PER_SECOND = (125, 250, 500, 1000, 2000)
#: Number of steps of the reference run in each step of the piecewise linear motion.
CUTS = 16


class Convergence(NamedTuple):
    """Errors for k step sizes, by output, as fractions of the output's largest value.

    Attributes
    ----------
    step
        (k,) s.
    angles
        (k,) by output, if only angles are set.
    rates
        (k,) by output, if rates are set as well (use_omega).
    piecewise_linear
        (k,) by output, for motors that turn at a constant, given rate in each step, where the FMU is exact.
    """

    step: np.ndarray
    angles: dict[str, np.ndarray]
    rates: dict[str, np.ndarray]
    piecewise_linear: dict[str, np.ndarray]


def convergence(fmu: Path, model: StateSpace) -> Convergence:
    """Errors of the FMU for ever smaller steps, compared with the exact response of its linear model `model` or, for piecewise
    linear motion, with a run of finer steps. The model must have the outputs CHANNELS."""
    errors = [
        (_error(fmu, model, n, False), _error(fmu, model, n, True), _piecewise_linear_error(fmu, n))
        for n in STEPS_PER_SECOND
    ]
    angles, rates, piecewise_linear = (
        {name: np.array([e[way][name] for e in errors]) for name in CHANNELS} for way in range(3)
    )
    return Convergence(1 / np.array(STEPS_PER_SECOND, dtype=float), angles, rates, piecewise_linear)


def order(step: np.ndarray, errors: dict[str, np.ndarray]) -> dict[str, float]:
    """The order of convergence by output name, between the two smallest steps."""
    return {name: float(np.log(e[-2] / e[-1]) / np.log(step[-2] / step[-1])) for name, e in errors.items()}


def exact_response(model: StateSpace, time: np.ndarray) -> dict[str, np.ndarray]:
    """Exact response to the motion, from rest at its initial angles: forced sinusoids, plus transients calculated from the
    eigenvectors of A."""
    motors = [(model.inputs.index(f"theta{i}"), model.inputs.index(f"omega{i}")) for i in (1, 2)]
    x, y = np.zeros((len(time), len(model.states))), np.zeros((len(time), len(model.outputs)))
    start = np.zeros(len(model.states))
    for i, (theta, omega) in enumerate(motors):
        w, phasor = RATE[i], AMPLITUDE[i] * np.exp(1j * PHASE[i])
        forced = np.linalg.solve(1j * w * np.eye(len(x[0])) - model.A, model.B[:, theta] + 1j * w * model.B[:, omega])
        wave = phasor * np.exp(1j * w * time)[:, None]
        x += (wave * forced).imag
        y += (wave * (model.D[:, theta] + 1j * w * model.D[:, omega])).imag
        side = [model.states.index(name) for name in (("theta3", "theta5"), ("theta4", "theta6"))[i]]
        start[side] = phasor.imag
    values, vectors = np.linalg.eig(model.A)
    x += ((np.exp(np.outer(time, values)) * np.linalg.solve(vectors, start - x[0])) @ vectors.T).real
    return dict(zip(model.outputs, (y + x @ model.C.T).T))


def _sines(n: int) -> Motion:
    time = np.arange(round(DURATION * n) + 1) / n
    angle = np.outer(time, RATE) + PHASE
    return Motion(time, AMPLITUDE * np.sin(angle), AMPLITUDE * RATE * np.cos(angle))


def _run(fmu: Path, motion: Motion) -> dict[str, np.ndarray]:
    with Testbed(fmu) as testbed:
        return testbed.respond(motion)


def _error(fmu: Path, model: StateSpace, n: int, rates: bool) -> dict[str, float]:
    motion = _sines(n)
    found = _run(fmu, motion if rates else replace(motion, omega=None))
    return _largest(found, exact_response(model, motion.time), motion.time >= FROM)


def _piecewise_linear_error(fmu: Path, n: int) -> dict[str, float]:
    corners = _sines(n)
    slope = np.diff(corners.theta, axis=0) * n
    # Each line consists of a corner and CUTS - 1 further points. The rate at a corner is the rate of the next line.
    way = np.arange(CUTS)[None, :, None] / CUTS
    theta = np.vstack([(corners.theta[:-1, None] + way * slope[:, None] / n).reshape(-1, 2), corners.theta[-1:]])
    rate = np.vstack([np.repeat(slope, CUTS, axis=0), slope[-1:]])
    time = np.arange(len(theta)) / (n * CUTS)
    fine = _run(fmu, Motion(time, theta, rate))
    coarse = _run(fmu, Motion(time[::CUTS], theta[::CUTS], rate[::CUTS]))
    return _largest(coarse, {name: values[::CUTS] for name, values in fine.items()}, time[::CUTS] >= FROM)


def _largest(found: Mapping[str, Array], true: Mapping[str, Array], late: np.ndarray) -> dict[str, float]:
    return {name: float(np.abs(found[name] - true[name])[late].max() / np.abs(true[name]).max()) for name in CHANNELS}
