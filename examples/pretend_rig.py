"""A testbed to practise on: writes simulated sensor signals of a motion, for `prw identify`.

    python examples/pretend_rig.py MOTION.csv RUN.csv [--seed N] [--noise N] [--measure tau1,tau2,theta3,theta4,pitch,roll]
        [--friction TORQUE]

The FMU runs with random parameters, which --seed selects. With --friction (N.m), the bearings of both input shafts have dry friction,
which the FMU does not have, so this script integrates the equations of motion itself. The sensors add errors to its outputs: encoders have 10000
counts per revolution, the noise is 20 mN.m for torques and 0.06 deg for the inertial sensor, and each sensor has an
unknown offset. The errors differ from run to run, unless --noise selects them.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline
from scipy.linalg import expm

import prw
from prw.arguments import check_names, counted, not_negative
from prw.recording import read_motion
from prw.testbed import Testbed

ENCODER = 360 / 10_000
#: Number of FMU steps between two rows of the file. Motors move smoothly between the rows.
STEPS = 20
CHOSEN = ("k1", "k2", "c1", "c2", "c3")
MEASURED = ("tau1", "tau2", "theta3", "theta4", "pitch", "roll")


def smoothly(motion: prw.Motion) -> prw.Motion:
    """The motion with STEPS communication points for each point of `motion`."""
    rows = np.arange(len(motion.time))
    time = np.interp(np.arange(STEPS * (len(rows) - 1) + 1) / STEPS, rows, motion.time)
    if motion.omega is None:
        path = CubicSpline(motion.time, motion.theta)
    else:
        path = CubicHermiteSpline(motion.time, motion.theta, motion.omega)
    return prw.Motion(time, path(time), path(time, 1), motion.name)


def with_friction(
    motion: prw.Motion, truth: dict[str, float], friction: float, fmu: Path | None
) -> dict[str, NDArray[np.float64]]:
    """The outputs of a wrist with dry friction (N.m) in both input shafts, from rest, in steps between which motors move evenly."""
    assert motion.omega is not None
    model, step = prw.linearize(truth, fmu=fmu), float(motion.time[1] - motion.time[0])
    with Testbed(fmu) as testbed:
        known = testbed.starts
    turns = model.C[[model.outputs.index("pitch_rate"), model.outputs.index("roll_rate")]][:, 4:]
    inertia = known["J2"] * np.eye(2) + turns.T @ np.diag([known["H3"], known["J3"]]) @ turns
    brake = -friction * step * np.linalg.inv(inertia)
    inputs = np.hstack([motion.theta, motion.omega])
    advance = expm(model.A * step)
    driven = (inputs[1:] + inputs[:-1]) / 2 @ np.linalg.solve(model.A, (advance - np.eye(6)) @ model.B).T
    states = np.zeros((len(inputs), 6))
    states[0, :4] = np.tile(motion.theta[0], 2)
    for k, more in enumerate(driven):
        states[k + 1] = advance @ states[k] + more
        # The sign of the rates, smooth below 0.01 rad/s.
        states[k + 1, 4:] += brake @ np.tanh(states[k, 4:] / 0.01)
    return dict(zip(model.outputs, (states @ model.C.T + inputs @ model.D.T).T))


def main() -> None:
    """Read the motion, run the rig, write the measurements."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("motion", type=Path)
    parser.add_argument("run", type=Path)
    parser.add_argument("--seed", type=int, default=1, help="selects the parameters (default: %(default)s)")
    parser.add_argument("--noise", type=int, help="seed that selects the errors of the sensors; it is not their size")
    parser.add_argument("--measure", default=",".join(MEASURED), help="channels (default: %(default)s)")
    parser.add_argument("--friction", type=float, default=0.0, help="of each input shaft, N.m")
    parser.add_argument("--fmu", type=Path, help="the testbed FMU (default: the FMU that prw finds)")
    options = parser.parse_args()
    counted("--seed", options.seed, 0)
    counted("--noise", options.noise or 0, 0)
    not_negative("--friction", options.friction)
    check_names("--measure", options.measure.split(","), MEASURED)
    rig, sensors = np.random.default_rng(options.seed), np.random.default_rng(options.noise)
    motion = read_motion(options.motion)
    with Testbed(options.fmu) as testbed:
        truth = {name: testbed.starts[name] * float(rig.uniform(0.75, 1.3)) for name in CHOSEN}
        response = {} if options.friction else testbed.respond(smoothly(motion), start=truth)
    response = response or with_friction(smoothly(motion), truth, options.friction, options.fmu)
    response = {name: values[::STEPS] for name, values in response.items()}
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
    try:
        main()
    except (prw.UserError, OSError) as error:
        sys.exit(f"pretend_rig.py: {error}")
