"""A testbed to be identified: the oracle's equations of motion, driven smoothly, behind sensors that are not perfect.

Nothing here comes from the FMU or from `prw`. The motors follow sums of sines between which there is no common period;
the response to each is exact (transfer function), and so is the transient from rest (eigenvalues).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from lagrange import linear_model, pitch_roll, table_1

SHAFT_SENSORS = ("theta3", "theta4")
ALL = ("tau1", "tau2", "theta3", "theta4", "pitch", "roll")
#: Estimated by default.
NAMES = ("k1", "k2", "c1", "c2", "c3")
#: Encoder: 2500 lines, read four times a line.
COUNTS = 10_000


class Truth(NamedTuple):
    """parameters: SI. time (n,) s. theta, omega: (n, 2) rad, rad/s. outputs: (n,) each, SI."""

    parameters: dict[str, float]
    time: np.ndarray
    theta: np.ndarray
    omega: np.ndarray
    outputs: dict[str, np.ndarray]


def experiment(
    seed: int, duration: float = 10.0, rate: float = 1000.0, pattern: str = "independent", spread: float = 0.3
) -> Truth:
    """A random rig in a random motion: NAMES up to `spread` off Table 1, 40 sines from 0.1 to 20 Hz a motor, 30 deg.
    Both motors in the same motion or in opposite ones, or each in its own; "fig4": the paper's, over and over; "slow":
    slow smooth moves with small vibrations of 2 to 22 Hz on top."""
    random = np.random.default_rng(seed)
    parameters = dict(table_1())
    for name in NAMES:
        parameters[name] *= float(np.exp(random.uniform(-1, 1) * np.log(1 + spread)))
    time = np.arange(int(round(duration * rate)) + 1) / rate
    if pattern == "fig4":
        return respond(parameters, time, np.array([5.0]), np.array([[-1.0], [1.0]]), 1 / (10 * np.pi))
    if pattern == "slow":
        frequency = np.concatenate([np.sort(random.uniform(0.1, 0.6, 5)), np.sort(random.uniform(2, 22, 12))])
        size = np.concatenate([np.full(5, 0.2), random.uniform(0.0003, 0.003, 12)])
        waves = size * np.exp(1j * random.uniform(0, 2 * np.pi, (2, 17)))
        return respond(parameters, time, frequency, waves)
    frequency = np.sort(random.uniform(0.1, 20, 40))
    size = np.minimum(1, (2 / frequency) ** 1.5)
    phases = random.uniform(0, 2 * np.pi, (2, 40))
    waves = [size * np.exp(1j * phase) for phase in phases]
    first, second = waves
    waves = {"independent": (first, second), "equal": (first, first), "opposite": (first, -first)}[pattern]
    return respond(parameters, time, frequency, np.array(waves))


def respond(parameters, time: np.ndarray, frequency: np.ndarray, waves: np.ndarray, reach: float = 0.52) -> Truth:
    """What the rig does when motor i follows the real part of the sum of waves[i] exp(2 pi i f t), scaled to `reach`
    rad, from rest at its first angle."""
    s = 2j * np.pi * frequency
    turning = np.exp(np.outer(time, s))
    scale = reach / max(np.abs((turning @ wave).real).max() for wave in waves)
    waves = scale * waves
    theta = (turning @ waves.T).real
    omega = ((turning * s) @ waves.T).real
    model = linear_model(parameters)
    response = np.array(
        [
            np.linalg.solve(sk * np.eye(6) - model.a, (model.b_angle + sk * model.b_rate) @ wave)
            for sk, wave in zip(s, waves.T)
        ]
    )
    steady = (turning @ response).real
    missing = np.concatenate([theta[0], theta[0], [0, 0]]) - steady[0]
    values, vectors = np.linalg.eig(model.a)
    transient = (np.exp(np.outer(time - time[0], values)) * np.linalg.solve(vectors, missing)) @ vectors.T
    x = steady + transient.real
    tau = x @ model.c.T + theta @ model.d_angle.T + omega @ model.d_rate.T
    pitch, roll = pitch_roll(x[:, 2], x[:, 3], parameters)
    outputs = {
        "tau1": tau[:, 0],
        "tau2": tau[:, 1],
        "theta3": x[:, 0],
        "theta4": x[:, 1],
        "pitch": pitch,
        "roll": roll,
    }
    return Truth(parameters, time, theta, omega, outputs)


def measure(truth: Truth, seed: int, channels: Sequence[str] = ALL, counts: int = COUNTS, log_rates: bool = False):
    """What the sensors say, by column in SI: encoders on motors and shafts, each with its own zero; torques with 20
    mN.m of noise, steps of 5 mN.m and an offset; an inertial sensor with 1 mrad of noise and an offset on pitch and
    roll."""
    random = np.random.default_rng(seed)
    quantum = 2 * np.pi / counts

    def encoder(angle: np.ndarray, zero: float) -> np.ndarray:
        return np.round(angle / quantum + random.uniform(-0.5, 0.5)) * quantum + zero

    found = {"time": truth.time}
    for i in (0, 1):
        found[f"theta{i + 1}"] = encoder(truth.theta[:, i], 0.0)
        if log_rates:
            found[f"omega{i + 1}"] = truth.omega[:, i] + random.normal(0, 0.02, len(truth.time))
    for name in channels:
        y = truth.outputs[name]
        if name.startswith("tau"):
            noisy = y + random.normal(0, 0.02, len(y)) + random.uniform(-0.2, 0.2)
            found[name] = np.round(noisy / 0.005) * 0.005
        elif name in SHAFT_SENSORS:
            found[name] = encoder(y, random.uniform(-0.1, 0.1))
        else:
            found[name] = y + random.normal(0, 1e-3, len(y)) + random.uniform(-0.02, 0.02)
    return found


def write(path, columns: dict[str, np.ndarray], units: dict[str, tuple] | None = None, rows=slice(None)) -> None:
    """Write the columns as CSV with nine digits. units: (unit, factor) by column, written into the header."""
    units = units or {}
    header = [f"{name} [{units[name][0]}]" if name in units else name for name in columns]
    table = np.column_stack([column / units.get(name, ("", 1.0))[1] for name, column in columns.items()])
    np.savetxt(path, table[rows], fmt="%.9g", delimiter=",", header=",".join(header), comments="")
