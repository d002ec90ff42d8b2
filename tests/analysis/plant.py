"""A testbed with what real rigs add, integrated by SciPy: it uses neither the FMU, nor `prw`, nor the oracle's equations.

The torque balances were derived by hand from eqs. (1), (5), (6) and (7) of the paper. Errors of the paper are corrected: the last
spring of eq. (6) is k2, theta7 is pitch and theta8 is roll, and the values of Table 1 are per degree.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from rig import Rig
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

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


#: Lowest and highest frequency of a motion, Hz, its number of sines, and the exponent with which their amplitudes fall
#: over frequency.
MOTIONS = {
    "broad": (0.1, 20.0, 30, 1.5),
    "gentle": (0.1, 10.0, 20, 2.0),
    "narrow": (1.0, 15.0, 12, 1.0),
    "slow": (0.1, 3.0, 8, 1.0),
}
#: Greatest number of sines in a motion.
MOST = max(count for _, _, count, _ in MOTIONS.values())


class Case(NamedTuple):
    """A random testbed with stiffness and damping up to 30 % off Table 1, and what reality adds to it.

    Attributes
    ----------
    seed
        Of the parameters and the motion.
    motion
        A key of MOTIONS.
    friction
        N.m, of the two input shafts.
    output_friction
        N.m, about pitch and about roll.
    play
        rad, the ranges of twist in which the springs k1 and k2 transmit no torque.
    cubic
        rad^-2: the springs k1 and k2 transmit k (twist + cubic twist^3).
    inertia
        Factors of J2, J3 and H3, which the parameters of the rig do not contain, as if the drawing were wrong.
    softening
        Fraction by which k1 falls in the middle of the recording.
    falling
        Fraction by which k2 falls evenly during the recording.
    sides
        Factors from k1, k2, c1 and c2 to the values of side 2.
    viscous
        N.m.s/rad, of the two input shafts and of the two shafts between the couplings.
    loose
        Whether the dampers of the couplings have the play, too. Then their sides press against each other, but do not pull.
    """

    seed: int
    motion: str = "broad"
    friction: tuple[float, float] = (0.0, 0.0)
    output_friction: float = 0.0
    play: tuple[float, float] = (0.0, 0.0)
    cubic: tuple[float, float] = (0.0, 0.0)
    inertia: tuple[float, float, float] = (1.0, 1.0, 1.0)
    softening: float = 0.0
    falling: float = 0.0
    sides: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    viscous: tuple[float, float] = (0.0, 0.0)
    loose: bool = False


def drives(random: np.random.Generator, motion: str, reach: float = 0.5) -> np.ndarray:
    """Returns a motion of MOTIONS up to about `reach` rad, in which each motor has its own phases: the frequencies (Hz) and the
    complex amplitudes (rad) of the sines of both motors, (3, MOST), filled up with zeros."""
    low, high, count, fall = MOTIONS[motion]
    found = np.zeros((3, MOST), dtype=complex)
    found[0, :count] = np.geomspace(low, high, count) * random.uniform(0.95, 1.05, count)
    found[1:, :count] = np.minimum(1.0, found[0, :count].real ** -fall) * np.exp(
        1j * random.uniform(0, 2 * np.pi, (2, count))
    )
    angle = np.exp(2j * np.pi * np.outer(np.linspace(0, 10, 2001), found[0].real)) @ found[1:].T
    found[1:] *= reach / np.abs(angle.imag).max()
    return found


def experiment(
    seed: int, friction: float | tuple[float, float] = 0.0, motion: str = "broad", duration: float = 8.0, **more
) -> Rig:
    """Simulates one case. friction: N.m, one value for both input shafts or one for each. more: fields of Case."""
    both = np.broadcast_to(friction, 2).tolist()
    return experiments([Case(seed, motion, (both[0], both[1]), **more)], duration)[0]


def experiments(cases: Sequence[Case], duration: float = 8.0, rate: float = 1000.0) -> list[Rig]:
    """Simulates testbeds that start at rest at the motors' first angles, all in one integration."""
    parameters, moves = [], []
    for case in cases:
        random = np.random.default_rng(case.seed)
        parameters.append({name: value * 1.3 ** random.uniform(-1, 1) for name, value in ESTIMATED.items()})
        moves.append(drives(random, case.motion))
    # The last axis of all arrays is the case.
    k1, k2, c1, c2, c3 = np.array([list(p.values()) for p in parameters]).T
    moved = np.moveaxis(np.array(moves), 0, -1)
    turning, amplitudes = 2j * np.pi * moved[0].real, moved[1:]
    friction, play, cubic = (np.array([getattr(c, n) for c in cases]).T for n in ("friction", "play", "cubic"))
    j2, j3, h3 = np.array([c.inertia for c in cases]).T * np.array([[J2], [J3], [H3]])
    output_friction, softening, falling = np.array([(c.output_friction, c.softening, c.falling) for c in cases]).T
    slow, between = np.array([c.viscous for c in cases]).T
    loose = np.array([c.loose for c in cases]) & (play > 0)
    # (side, case)
    k1, k2, c1, c2 = (np.stack([p, p * f]) for p, f in zip((k1, k2, c1, c2), np.array([c.sides for c in cases]).T))

    def motors(time: float) -> tuple[np.ndarray, np.ndarray]:
        waves = amplitudes * np.exp(turning * time)
        return waves.sum(axis=1).imag, (waves * turning).sum(axis=1).imag

    def spring(k: np.ndarray, i: int, twist: np.ndarray) -> np.ndarray:
        return k * (twist - np.clip(twist, -play[i] / 2, play[i] / 2) + cubic[i] * twist**3)

    def lets_go(i: int, twist: np.ndarray, torque: np.ndarray) -> np.ndarray:
        return loose[i] & ((np.abs(twist) <= play[i] / 2) | (torque * twist < 0))

    def torques(time: float, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Returns the torques on the motors, and the torques and rates of the shafts between the couplings."""
        (angle, omega), soft = motors(time), 1 - softening * (time > duration / 2)
        # These shafts have no inertia, so both couplings of a side transmit the same torque, except for friction.
        first = spring(k1 * soft, 0, angle - x[:2])
        second = spring(k2 * (1 - falling * time / duration), 1, x[:2] - x[2:4])
        shaft_rate = (first + c1 * omega - second + c2 * x[4:]) / (c1 + c2 + between)
        # If one coupling transmits nothing, the rate is that with which the other one transmits nothing either.
        open_1 = lets_go(0, angle - x[:2], first + c1 * (omega - shaft_rate))
        open_2 = lets_go(1, x[:2] - x[2:4], second + c2 * (shaft_rate - x[4:]))
        shaft_rate = np.where(open_1, (c2 * x[4:] - second) / (c2 + between), shaft_rate)
        shaft_rate = np.where(open_2, (first + c1 * omega) / (c1 + between), shaft_rate)
        on_motors = np.where(open_1, 0.0, -first - c1 * (omega - shaft_rate))
        return on_motors, np.where(open_2, 0.0, second + c2 * (shaft_rate - x[4:])), shaft_rate

    def slope(time: float, flat: np.ndarray) -> np.ndarray:
        x = flat.reshape(6, -1)
        _, drive, shaft_rate = torques(time, x)
        drive = drive - friction * np.tanh(x[4:] / KNEE) - slow * x[4:]
        pitch_rate, roll_rate = (x[4] + x[5]) / 2, RATIO * (x[4] - x[5])
        pitching, rolling = (c3 * r + output_friction * np.tanh(r / KNEE) for r in (pitch_rate, roll_rate))
        # Each input shaft carries half of the pitch torque, plus or minus RATIO times the roll torque. So the sum of the two
        # shaft equations has only pitch, and their difference has only roll.
        together = (drive[0] + drive[1] - pitching) / (j2 + h3 / 2)
        apart = (drive[0] - drive[1] - 2 * RATIO * rolling) / (j2 + 2 * RATIO**2 * j3)
        return np.concatenate([shaft_rate.ravel(), x[4:].ravel(), (together + apart) / 2, (together - apart) / 2])

    time = np.arange(int(round(duration * rate)) + 1) / rate
    first = motors(0.0)[0].ravel()
    start = np.concatenate([first, first, 0 * first])
    accuracy = {"method": "DOP853", "rtol": 1e-7, "atol": 1e-9, "max_step": 4e-3}
    solved = solve_ivp(slope, (0.0, time[-1]), start, t_eval=time, **accuracy)
    assert solved.success, solved.message
    states = solved.y.reshape(6, len(cases), -1)
    angles = np.array([motors(t) for t in time])
    tau = np.array([torques(t, x)[0] for t, x in zip(time, np.moveaxis(states, -1, 0))])
    found = []
    for i, p in enumerate(parameters):
        x = states[:, i]
        columns = {
            "theta": angles[:, 0, :, i],
            "omega": angles[:, 1, :, i],
            **{"tau1": tau[:, 0, i], "tau2": tau[:, 1, i], "theta3": x[0], "theta4": x[1]},
            **{"pitch": (x[2] + x[3]) / 2, "roll": RATIO * (x[2] - x[3])},
        }
        path = CubicSpline(time, np.column_stack([*columns.values()]))

        def at(when: np.ndarray, path=path) -> dict[str, np.ndarray]:
            y = path(when).T
            return {"theta": y[:2].T, "omega": y[2:4].T, **dict(zip(("tau1", "tau2", "theta3", "theta4"), y[4:8]))} | {
                "pitch": y[8],
                "roll": y[9],
            }

        whole = {"J2": J2, "J3": J3, "H3": H3, **p, "M": 4, "N": 7}
        found.append(Rig(whole, time, columns.pop("theta"), columns.pop("omega"), columns, at))
    return found
