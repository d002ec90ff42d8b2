"""The testbed between two motors with inertia, from energies and Lagrange's equation. SciPy integrates it.

The motors' angles are coordinates here, not inputs: the kinetic energy contains J1/2 (theta1'^2 + theta2'^2) of eq. (3), and the
generalized forces are the motors' torques. So neither eq. (9) nor the sign of its torques is used, although the results show both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from lagrange import CARRIER, MOTOR, SHAFT, dissipation, hessian, kinetic_energy, pitch_roll, potential_energy
from scipy.integrate import solve_ivp

#: Data of a motor and gains of its loops, as in examples/openmodelica/TorqueDriven.mo, in SI units.
MOTOR_DATA = {"J1": 2e-3, "friction": 0.05, "creep": 0.02, "damping": 2e-3, "R": 1.0, "L": 2e-3, "k": 0.5}
GAINS = {"stiffness": 40.0, "damping": 0.6, "proportional": 2.0, "integral": 1000.0}
#: Goal of the move in rad, and its duration in s.
PITCH, ROLL, DURATION = np.pi / 6, np.pi / 3, 0.6


def reference(t: float) -> tuple[np.ndarray, np.ndarray]:
    """Motor angles (rad) and rates (rad/s), (2,) each, for a wrist that moves to the goal along half a cosine and stays there."""
    goal = np.array([PITCH + 4 / 7 * ROLL, PITCH - 4 / 7 * ROLL])
    if t >= DURATION:
        return goal, 0 * goal
    phase = np.pi * t / DURATION
    return goal * (1 - np.cos(phase)) / 2, goal * np.pi / (2 * DURATION) * np.sin(phase)


@dataclass(frozen=True)
class Trajectory:
    """theta, omega, current, tau: (n, 2) each, of both motors, in rad, rad/s, A, N.m. pitch, roll: (n,) rad."""

    theta: np.ndarray
    omega: np.ndarray
    current: np.ndarray
    tau: np.ndarray
    pitch: np.ndarray
    roll: np.ndarray


class Mechanics:
    """The equations of motion. The state is (theta1..theta6, theta1', theta2', theta5', theta6'), in rad and rad/s."""

    #: Indices of the angles of parts with inertia.
    HEAVY = (0, 1, 4, 5)

    def __init__(self, parameters: Mapping[str, float], inertia: float):
        self.stiff, self.damp = hessian(potential_energy, parameters), hessian(dissipation, parameters)
        mass = hessian(kinetic_energy, parameters)
        mass[MOTOR, MOTOR] += inertia * np.eye(2)
        self.inverse_mass = np.linalg.inv(mass[np.ix_(self.HEAVY, self.HEAVY)])
        self.shafts = np.linalg.inv(self.damp[SHAFT, SHAFT])

    def rates(self, x: np.ndarray) -> np.ndarray:
        """Returns all six rates. The massless shafts turn so that the torques on each of them add up to zero."""
        rate = np.zeros(6)
        rate[list(self.HEAVY)] = x[6:10]
        rate[SHAFT] = -self.shafts @ (self.stiff[SHAFT] @ x[:6] + self.damp[SHAFT] @ rate)
        return rate

    def slope(self, x: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """Returns the derivative of the state while torques (2,) N.m act on the motors."""
        rate = self.rates(x)
        force = -(self.stiff @ x[:6] + self.damp @ rate)
        force[MOTOR] += torque
        return np.concatenate([rate, self.inverse_mass @ force[list(self.HEAVY)]])

    def torques(self, x: np.ndarray) -> np.ndarray:
        """Returns the torques (2,) N.m of the wrist on the motors: the generalized forces without the torques of the motors."""
        return -(self.stiff @ x[:6] + self.damp @ self.rates(x))[MOTOR]


def pushed(
    time: np.ndarray, parameters: Mapping[str, float], inertia: float, torque: Callable[[float], np.ndarray]
) -> Trajectory:
    """Integrates from rest, while the smooth function `torque` of time drives the motors with (2,) N.m. The currents are 0."""
    mechanics = Mechanics(parameters, inertia)
    found = solve_ivp(
        lambda t, x: mechanics.slope(x, torque(t)), time[[0, -1]], np.zeros(10), "DOP853", time, rtol=1e-12, atol=1e-14
    )
    return _trajectory(mechanics, found.y, np.zeros((2, len(time))), parameters)


def _trajectory(
    mechanics: Mechanics, states: np.ndarray, current: np.ndarray, parameters: Mapping[str, float]
) -> Trajectory:
    tau = np.array([mechanics.torques(x) for x in states.T])
    pitch, roll = pitch_roll(*states[CARRIER], parameters)
    return Trajectory(states[MOTOR].T, states[6:8].T, current.T, tau, pitch, roll)


def simulate(
    time: np.ndarray,
    parameters: Mapping[str, float],
    motor: Mapping[str, float] = MOTOR_DATA,
    gains: Mapping[str, float] = GAINS,
    references: Callable[[float], tuple[np.ndarray, np.ndarray]] = reference,
    breaks: tuple[float, ...] = (DURATION,),
) -> Trajectory:
    """Integrates the machine from rest at zero angles to the times (n,) s. The angles and rates of `references` are smooth between
    `breaks`.

    The state is (theta1..theta6, theta1', theta2', theta5', theta6', both currents, both integral parts)."""
    mechanics = Mechanics(parameters, motor["J1"])

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        theta, rate, current, integral = x[MOTOR], x[6:8], x[10:12], x[12:14]
        theta_ref, omega_ref = references(t)
        wanted = gains["stiffness"] * (theta_ref - theta) + gains["damping"] * (omega_ref - rate)
        error = wanted / motor["k"] - current
        voltage = gains["proportional"] * error + integral
        dry = motor["friction"] * np.tanh(rate / motor["creep"])
        torque = motor["k"] * current - motor["damping"] * rate - dry
        flow = (voltage - motor["R"] * current - motor["k"] * rate) / motor["L"]
        return np.concatenate([mechanics.slope(x[:10], torque), flow, gains["integral"] * error])

    ends = [b for b in breaks if time[0] < b < time[-1]] + [time[-1]]
    begin, x, parts = time[0], np.zeros(14), [np.zeros((14, 1))]
    for end in ends:
        at = time[(time > begin) & (time <= end)]
        found = solve_ivp(slope, (begin, end), x, "LSODA", np.union1d(at, [end]), rtol=1e-11, atol=1e-13)
        parts.append(found.y[:, np.isin(found.t, at)])
        begin, x = end, found.y[:, -1]
    states = np.hstack(parts)
    return _trajectory(mechanics, states[:10], states[10:12], parameters)
