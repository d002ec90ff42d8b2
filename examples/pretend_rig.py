"""A testbed to practise on: writes simulated sensor signals of a motion, for `prw identify`.

    python examples/pretend_rig.py MOTION.csv RUN.csv [--seed N] [--noise N] [--measure tau1,tau2,theta3,theta4,pitch,roll]

The FMU runs with random parameters, which --seed selects. The sensors add errors to its outputs: encoders have 10000
counts per revolution, the noise is 20 mN.m for torques and 0.06 deg for the inertial sensor, and each sensor has an
unknown offset. The errors differ from run to run, unless --noise selects them.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline

import prw
from prw.recording import read_motion
from prw.testbed import Testbed

ENCODER = 360 / 10_000
#: Number of FMU steps between two rows of the file. Motors move smoothly between the rows.
STEPS = 20
CHOSEN = ("k1", "k2", "c1", "c2", "c3")


def smoothly(motion: prw.Motion) -> prw.Motion:
    """The motion with STEPS communication points for each point of `motion`."""
    rows = np.arange(len(motion.time))
    time = np.interp(np.arange(STEPS * (len(rows) - 1) + 1) / STEPS, rows, motion.time)
    if motion.omega is None:
        path = CubicSpline(motion.time, motion.theta)
    else:
        path = CubicHermiteSpline(motion.time, motion.theta, motion.omega)
    return prw.Motion(time, path(time), path(time, 1), motion.name)


def main() -> None:
    """Read the motion, run the rig, write the measurements."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("motion", type=Path)
    parser.add_argument("run", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", type=int)
    parser.add_argument("--measure", default="tau1,tau2,theta3,theta4,pitch,roll")
    parser.add_argument("--fmu", type=Path, default=Path("target/fmu/prw_testbed.fmu"))
    options = parser.parse_args()
    rig, sensors = np.random.default_rng(options.seed), np.random.default_rng(options.noise)
    motion = read_motion(options.motion)
    with Testbed(options.fmu) as testbed:
        truth = {name: testbed.starts[name] * float(rig.uniform(0.75, 1.3)) for name in CHOSEN}
        response = {name: values[::STEPS] for name, values in testbed.respond(smoothly(motion), start=truth).items()}
    shown = (f"{name} {value:.5g} {'N.m/rad' if name[0] == 'k' else 'N.m.s/rad'}" for name, value in truth.items())

    def encoder(angle: NDArray[np.float64]) -> NDArray[np.float64]:
        counts: NDArray[np.float64] = np.round(np.degrees(angle) / ENCODER + sensors.uniform(-0.5, 0.5))
        return counts * ENCODER

    columns = {"time [s]": motion.time}
    for i in (0, 1):
        columns[f"theta{i + 1} [deg]"] = encoder(motion.theta[:, i])
    for name in options.measure.split(","):
        if name.startswith("tau"):
            noise = sensors.normal(0, 0.02, len(motion.time)) + sensors.uniform(-0.2, 0.2)
            columns[f"{name} [N.m]"] = response[name] + noise
        elif name in ("theta3", "theta4"):
            columns[f"{name} [deg]"] = encoder(response[name]) + sensors.uniform(-5, 5)
        else:
            noise = sensors.normal(0, 0.06, len(motion.time)) + sensors.uniform(-1, 1)
            columns[f"{name} [deg]"] = np.degrees(response[name]) + noise
    np.savetxt(options.run, np.column_stack(list(columns.values())), "%.6f", ",", header=",".join(columns), comments="")
    print(f"wrote {options.run}; true parameters of the rig: {', '.join(shown)}")


if __name__ == "__main__":
    main()
