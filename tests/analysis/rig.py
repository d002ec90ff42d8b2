"""A simulated testbed for identification: the oracle's equations of motion, smooth motor motions, and sensors with errors.

The module uses neither the FMU nor `prw`. The motors follow sums of sines without a common period. The response to each
sine (transfer function) and the transient from rest (eigenvalues) are exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from lagrange import linear_model, pitch_roll, table_1
from scipy.signal import lfilter

SHAFT_SENSORS = ("theta3", "theta4")
ALL = ("tau1", "tau2", "theta3", "theta4", "pitch", "roll")
#: Parameters that `prw identify` estimates by default.
NAMES = ("k1", "k2", "c1", "c2", "c3")
#: Counts of an encoder per turn: 2500 lines with four counts each.
COUNTS = 10_000


class Rig(NamedTuple):
    """parameters: SI. time (n,) s. theta, omega: (n, 2) rad, rad/s. outputs: (n,) each, SI. at: theta, omega and outputs at any times."""

    parameters: dict[str, float]
    time: np.ndarray
    theta: np.ndarray
    omega: np.ndarray
    outputs: dict[str, np.ndarray]
    at: Callable[[np.ndarray], dict[str, np.ndarray]]


def experiment(seed: int, duration: float = 10.0, rate: float = 1000.0, pattern: str = "independent") -> Rig:
    """Simulates a random rig, with NAMES up to 30 % off Table 1, in a motion of at most 35 deg. All patterns except "fig4"
    are random:

    * "independent", "equal" and "opposite" motions of the two motors, 40 sines from 0.1 to 20 Hz each
    * "fig4": the motion of the paper's Fig. 4, repeated
    * "slow": slow smooth moves with small vibrations of 2 to 22 Hz
    * "moves": moves from point to point with rests between them, and three small sines"""
    random = np.random.default_rng(seed)
    parameters = dict(table_1())
    for name in NAMES:
        parameters[name] *= float(np.exp(random.uniform(-1, 1) * np.log(1.3)))
    time = np.arange(int(round(duration * rate)) + 1) / rate
    if pattern == "fig4":
        return respond(parameters, time, np.array([5.0]), np.array([[-1.0], [1.0]]), 1 / (10 * np.pi))
    if pattern == "slow":
        frequency = np.concatenate([np.sort(random.uniform(0.1, 0.6, 5)), np.sort(random.uniform(2, 22, 12))])
        size = np.concatenate([np.full(5, 0.2), random.uniform(0.0003, 0.003, 12)])
        waves = size * np.exp(1j * random.uniform(0, 2 * np.pi, (2, 17)))
        return respond(parameters, time, frequency, waves)
    if pattern == "moves":
        return respond(parameters, time, *_moves(random, duration), random.uniform(0.3, 0.6))
    frequency = np.sort(random.uniform(0.1, 20, 40))
    size = np.minimum(1, (2 / frequency) ** 1.5)
    phases = random.uniform(0, 2 * np.pi, (2, 40))
    waves = [size * np.exp(1j * phase) for phase in phases]
    first, second = waves
    waves = {"independent": (first, second), "equal": (first, first), "opposite": (first, -first)}[pattern]
    return respond(parameters, time, frequency, np.array(waves))


def _moves(random: np.random.Generator, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """Returns frequencies (m,) and waves (2, m) of minimum-jerk moves from point to point, and of three small sines for each motor.

    The moves are approximated by a Fourier series up to 15 Hz, because `respond` takes sines. The period of the series exceeds
    the recording."""
    period = duration + 4
    when, lines = np.linspace(0, period, 4096, endpoint=False), int(15 * period)
    waves = np.zeros((2, lines + 6), dtype=complex)
    for i in (0, 1):
        signal, at, begin = np.zeros(4096), 0.0, random.uniform(0, 0.5)
        while begin < duration + 2:
            # The last move returns to the first angle, because a jump at the end of the period would ring.
            to, takes = random.uniform(-1, 1) if begin < duration else 0.0, random.uniform(0.3, 1.2)
            x = np.clip((when - begin) / takes, 0, 1)
            signal += (to - at) * x**3 * (10 - 15 * x + 6 * x**2)
            at, begin = to, begin + takes + random.uniform(0, 0.6) if begin < duration else np.inf
        waves[i, :lines] = 2 * np.fft.rfft(signal)[:lines] / 4096
        waves[i, 0] /= 2
        waves[i, lines + 3 * i :][:3] = random.uniform(0.005, 0.05, 3) * np.exp(1j * random.uniform(0, 2 * np.pi, 3))
    return np.concatenate([np.arange(lines) / period, random.uniform(0.5, 15, 6)]), waves


def respond(parameters, time: np.ndarray, frequency: np.ndarray, waves: np.ndarray, reach: float = 0.52) -> Rig:
    """Returns the rig with its response from rest at the first motor angles. Motor k follows the real part of
    sum(waves[k] * exp(2j * pi * frequency * t)), scaled so that the largest angle of both motors is `reach` rad."""
    s = 2j * np.pi * frequency
    turning = np.exp(np.outer(time, s))
    scale = reach / max(np.abs((turning @ wave).real).max() for wave in waves)
    waves = scale * waves
    model = linear_model(parameters)
    response = np.array(
        [
            np.linalg.solve(sk * np.eye(6) - model.a, (model.b_angle + sk * model.b_rate) @ wave)
            for sk, wave in zip(s, waves.T)
        ]
    )
    steady = (np.exp(time[0] * s) @ response).real
    first = (np.exp(time[0] * s) @ waves.T).real
    missing = np.concatenate([first, first, [0, 0]]) - steady
    values, vectors = np.linalg.eig(model.a)
    share = np.linalg.solve(vectors, missing)

    def at(when: np.ndarray) -> dict[str, np.ndarray]:
        """Returns motor angles, rates and outputs at the times. Before the first time, everything has its first value."""
        when = np.maximum(when, time[0])
        turned = np.exp(np.outer(when, s))
        transient = (np.exp(np.outer(when - time[0], values)) * share) @ vectors.T
        x = (turned @ response).real + transient.real
        theta, omega = (turned @ waves.T).real, ((turned * s) @ waves.T).real
        tau = x @ model.c.T + theta @ model.d_angle.T + omega @ model.d_rate.T
        return {"theta": theta, "omega": omega, **_outputs(x, tau, parameters)}

    found = at(time)
    return Rig(parameters, time, found.pop("theta"), found.pop("omega"), found, at)


def _outputs(x: np.ndarray, tau: np.ndarray, parameters) -> dict[str, np.ndarray]:
    pitch, roll = pitch_roll(x[:, 2], x[:, 3], parameters)
    return {
        "tau1": tau[:, 0],
        "tau2": tau[:, 1],
        "theta3": x[:, 0],
        "theta4": x[:, 1],
        "pitch": pitch,
        "roll": roll,
    }


#: Integration steps of `nonlinear` and `lagging` between two samples of the recording.
FINE = 16


def nonlinear(simulated: Rig, backlash: float = 0.0, friction: float = 0.0) -> Rig:
    """Returns the rig with `backlash` rad of play between each motor and its shaft, and with `friction` N.m of dry friction
    about pitch and roll. Its outputs are integrated by Heun's method in fine steps."""
    p, model = simulated.parameters, linear_model(simulated.parameters)
    count = (len(simulated.time) - 1) * FINE + 1
    fine = np.interp(np.arange(count) / FINE, np.arange(len(simulated.time)), simulated.time)
    step = fine[1] - fine[0]
    motors = simulated.at(fine)
    theta, omega = motors["theta"], motors["omega"]
    if backlash:
        played = np.empty_like(theta)
        played[0] = theta[0]
        for k in range(1, count):
            played[k] = np.clip(played[k - 1], theta[k] - backlash / 2, theta[k] + backlash / 2)
        theta, omega = played, np.gradient(played, fine, axis=0)
    driven = theta @ model.b_angle.T + omega @ model.b_rate.T
    ratio = p["N"] / (2 * p["M"])
    turns = np.array([[0.5, 0.5], [ratio, -ratio]])
    inertia = p["J2"] * np.eye(2) + turns.T @ np.diag([p["H3"], p["J3"]]) @ turns
    brake = -friction * np.linalg.inv(inertia) @ turns.T

    def rate(x, k):
        found = model.a @ x + driven[k]
        found[4:] += brake @ np.tanh(turns @ x[4:] / 0.02)
        return found

    x = np.empty((count, 6))
    x[0] = np.concatenate([theta[0], theta[0], [0, 0]])
    for k in range(count - 1):
        slope = rate(x[k], k)
        x[k + 1] = x[k] + step / 2 * (slope + rate(x[k] + step * slope, k + 1))
    tau = x @ model.c.T + theta @ model.d_angle.T + omega @ model.d_rate.T
    outputs = {name: y[::FINE] for name, y in _outputs(x, tau, p).items()}
    return simulated._replace(outputs=outputs)


def lagging(simulated: Rig, seconds: float) -> Rig:
    """Returns the rig with a first-order lag in all sensors, which start in their steady state."""
    fine = np.interp(
        np.arange((len(simulated.time) - 1) * FINE + 1) / FINE, np.arange(len(simulated.time)), simulated.time
    )
    step, outputs = fine[1] - fine[0], {}
    decay, exact = np.exp(-step / seconds), simulated.at(fine)
    rise = 1 - seconds / step * (1 - decay)
    for name in simulated.outputs:
        y = exact[name]
        slow = lfilter([rise, 1 - rise - decay], [1, -decay], y - y[0]) + y[0]
        outputs[name] = slow[::FINE]
    return simulated._replace(outputs=outputs)


def late(simulated: Rig, seconds: float) -> Rig:
    """Returns the rig with torques that are recorded late."""
    delayed = simulated.at(simulated.time - seconds)
    return simulated._replace(outputs={**simulated.outputs, **{name: delayed[name] for name in ("tau1", "tau2")}})


def measure(
    simulated: Rig,
    seed: int,
    channels: Sequence[str] = ALL,
    counts: int = COUNTS,
    log_rates: bool = False,
    noise: float = 0.02,
):
    """Returns the columns that the sensors record, in SI.

    Angles of motors and shafts are quantised, and the zeros of shafts are unknown. Torques have `noise` N.m of noise, an offset, and
    steps of a quarter of the noise. Pitch and roll have 1 mrad of noise and an offset, as from an inertial sensor.
    log_rates: also records the motors' rates, with 0.02 rad/s of noise."""
    random = np.random.default_rng(seed)
    quantum = 2 * np.pi / counts

    def encoder(angle: np.ndarray, zero: float) -> np.ndarray:
        return np.round(angle / quantum + random.uniform(-0.5, 0.5)) * quantum + zero

    found = {"time": simulated.time}
    for i in (0, 1):
        found[f"theta{i + 1}"] = encoder(simulated.theta[:, i], 0.0)
        if log_rates:
            found[f"omega{i + 1}"] = simulated.omega[:, i] + random.normal(0, 0.02, len(simulated.time))
    for name in channels:
        y = simulated.outputs[name]
        if name.startswith("tau"):
            noisy = y + random.normal(0, noise, len(y)) + random.uniform(-0.2, 0.2)
            found[name] = np.round(noisy / (noise / 4)) * (noise / 4)
        elif name in SHAFT_SENSORS:
            found[name] = encoder(y, random.uniform(-0.1, 0.1))
        else:
            found[name] = y + random.normal(0, 1e-3, len(y)) + random.uniform(-0.02, 0.02)
    return found


def write(path, columns: dict[str, np.ndarray], units: dict[str, tuple] | None = None, rows=slice(None)) -> None:
    """Writes the columns as CSV with nine digits. units: for columns that are not in SI, the unit for the header and its size in SI."""
    units = units or {}
    header = [f"{name} [{units[name][0]}]" if name in units else name for name in columns]
    table = np.column_stack([column / units.get(name, ("", 1.0))[1] for name, column in columns.items()])
    np.savetxt(path, table[rows], fmt="%.9g", delimiter=",", header=",".join(header), comments="")
