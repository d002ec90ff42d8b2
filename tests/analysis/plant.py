"""A testbed with friction in its input shafts, integrated by SciPy: it uses neither the FMU, nor `prw`, nor the oracle's equations.

The torque balances were derived by hand from eqs. (1), (5), (6) and (7) of the paper. Errors of the paper are corrected: the last
spring of eq. (6) is k2, theta7 is pitch and theta8 is roll, and the values of Table 1 are per degree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from rig import Rig
from scipy.integrate import solve_ivp

#: Table 1 in SI units.
DEGREE = np.pi / 180
J2, J3, H3 = 3.8681291e-3, 1.2750004e-2, 4.2363841e-2
ESTIMATED = {
    "k1": 2.11 / DEGREE,
    "k2": 0.76 / DEGREE,
    "c1": 7.83e-3 / DEGREE,
    "c2": 8.35e-3 / DEGREE,
    "c3": 6.66e-3 / DEGREE,
}
#: Roll angle for a difference of one radian between the input shafts: N / (2 M), with 7 rollers and 4 lobes.
RATIO = 7 / (2 * 4)
#: Shaft rate, rad/s, about which dry friction is smoothed: its torque is proportional to tanh(rate / KNEE).
KNEE = 0.02


class Drives(NamedTuple):
    """Motion of the motors, each a sum of m sines. amplitude (2, m) rad, frequency (m,) Hz, phase (2, m) rad."""

    amplitude: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray

    def at(self, time: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Returns the motor angles and rates, (2, ...) rad and rad/s."""
        turned = np.multiply.outer(time, 2 * np.pi * self.frequency)
        angle = [np.sum(a * np.sin(turned + p), axis=-1) for a, p in zip(self.amplitude, self.phase)]
        rate = [
            np.sum(2 * np.pi * self.frequency * a * np.cos(turned + p), axis=-1)
            for a, p in zip(self.amplitude, self.phase)
        ]
        return np.array(angle), np.array(rate)


#: Lowest and highest frequency of a motion, Hz, its number of sines, and the exponent with which their amplitudes fall
#: over frequency.
MOTIONS = {
    "broad": (0.1, 20.0, 30, 1.5),
    "gentle": (0.1, 10.0, 20, 2.0),
    "narrow": (1.0, 15.0, 12, 1.0),
    "slow": (0.1, 3.0, 8, 1.0),
}


def drives(random: np.random.Generator, motion: str, reach: float = 0.5) -> Drives:
    """Returns a motion of MOTIONS up to about `reach` rad; each motor has its own phases."""
    low, high, count, fall = MOTIONS[motion]
    frequency = np.geomspace(low, high, count) * random.uniform(0.95, 1.05, count)
    phase = random.uniform(0, 2 * np.pi, (2, count))
    found = Drives(np.tile(np.minimum(1.0, frequency**-fall), (2, 1)), frequency, phase)
    largest = np.abs(found.at(np.linspace(0, 10, 2001))[0]).max()
    return found._replace(amplitude=found.amplitude * reach / largest)


def experiment(
    seed: int,
    friction: float | tuple[float, float] = 0.0,
    motion: str = "broad",
    duration: float = 8.0,
    rate: float = 1000.0,
) -> Rig:
    """Simulates a random testbed with stiffness and damping up to 30 % off Table 1, which starts at rest at the motors' first angles.
    friction: N.m, one value for both input shafts or one for each."""
    random = np.random.default_rng(seed)
    p = {name: value * 1.3 ** random.uniform(-1, 1) for name, value in ESTIMATED.items()}
    motors, brake = drives(random, motion), np.broadcast_to(friction, 2)
    k1, k2, c1, c2, c3 = (p[name] for name in ESTIMATED)

    def slope(time: float, x: np.ndarray) -> np.ndarray:
        angle, turning = motors.at(time)
        shaft, carrier, carrier_rate = x[:2], x[2:4], x[4:]
        # The shafts between the couplings have no inertia, so both couplings of a side transmit the same torque.
        shaft_rate = (k1 * (angle - shaft) + c1 * turning - k2 * (shaft - carrier) + c2 * carrier_rate) / (c1 + c2)
        drive = k2 * (shaft - carrier) + c2 * (shaft_rate - carrier_rate) - brake * np.tanh(carrier_rate / KNEE)
        pitch_rate = (carrier_rate[0] + carrier_rate[1]) / 2
        roll_rate = RATIO * (carrier_rate[0] - carrier_rate[1])
        # Each input shaft carries half of the pitch torque, plus or minus RATIO times the roll torque. So the sum of the two
        # shaft equations has only pitch, and their difference has only roll.
        together = (drive[0] + drive[1] - c3 * pitch_rate) / (J2 + H3 / 2)
        apart = (drive[0] - drive[1] - 2 * RATIO * c3 * roll_rate) / (J2 + 2 * RATIO**2 * J3)
        return np.concatenate([shaft_rate, carrier_rate, [(together + apart) / 2, (together - apart) / 2]])

    time = np.arange(int(round(duration * rate)) + 1) / rate
    first = motors.at(0.0)[0]
    solved = solve_ivp(
        slope,
        (0.0, time[-1]),
        np.concatenate([first, first, [0, 0]]),
        method="DOP853",
        dense_output=True,
        rtol=1e-8,
        atol=1e-10,
        max_step=0.004,
    )
    assert solved.success, solved.message

    def outputs(when: np.ndarray) -> dict[str, np.ndarray]:
        x, (angle, turning) = solved.sol(when), motors.at(when)
        shaft_rate = (k1 * (angle - x[:2]) + c1 * turning - k2 * (x[:2] - x[2:4]) + c2 * x[4:]) / (c1 + c2)
        tau = k1 * (x[:2] - angle) + c1 * (shaft_rate - turning)
        return {
            "theta": angle.T,
            "omega": turning.T,
            "tau1": tau[0],
            "tau2": tau[1],
            "theta3": x[0],
            "theta4": x[1],
            "pitch": (x[2] + x[3]) / 2,
            "roll": RATIO * (x[2] - x[3]),
        }

    found = outputs(time)
    parameters = {"J2": J2, "J3": J3, "H3": H3, **p, "M": 4, "N": 7}
    return Rig(parameters, time, found.pop("theta"), found.pop("omega"), found, outputs)
