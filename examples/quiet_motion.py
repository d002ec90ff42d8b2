"""The smoothest motion that leaves no vibration, found with CasADi

You learn to load the FMU into CasADi, and to set up an optimal control problem with the derivatives that the FMU
returns. The motion is then replayed on the FMU: the wrist does not vibrate at the end, and vibrates little if the
assumed stiffness was wrong.

    make examples; .venv/bin/python examples/quiet_motion.py
"""

import tempfile
import zipfile

import casadi
import numpy as np
from matplotlib.figure import Figure
from scipy.linalg import expm

import prw

FMU = prw.default_fmu()
MOVE, AFTER, STEP = 0.25, 0.35, 2.5e-3  # s
GOAL = np.deg2rad([20, 30])  # pitch and roll, rad
SIDES = np.array([[1, 4 / 7], [1, -4 / 7]]) @ GOAL  # the motors' angles there: eq. (1) solved, M = 4, N = 7
RATE = 6.0  # limit of the motors, rad/s


def sampled() -> tuple[np.ndarray, np.ndarray]:
    """z+ = A z + B w over a step: z is the six states and both motors' angles; w is the motors' rates, which are constant in a step."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as directory, zipfile.ZipFile(FMU) as archive:
        archive.extractall(directory)
        wrist = casadi.DaeBuilder("wrist", directory).create("wrist", ["x", "u"], ["ode"])
        # The testbed is linear, so its derivatives are constant. CasADi gets them from the FMU.
        derivatives = wrist.jacobian()(np.zeros(6), np.zeros(4), np.zeros(6))
    generator = np.zeros((10, 10))
    generator[:6] = np.hstack([np.array(part) for part in derivatives])
    generator[6:8, 8:] = np.eye(2)
    transition = expm(STEP * generator)
    return transition[:8, :8], transition[:8, 8:]


def smoothest() -> np.ndarray:
    """The motors' rates (n, 2) in rad/s of the smoothest motion that is at rest at the goal after MOVE."""
    A, B = sampled()
    n, problem = round(MOVE / STEP), casadi.Opti()
    z, w = problem.variable(8, n + 1), problem.variable(2, n)
    problem.minimize(casadi.sumsqr(casadi.diff(casadi.horzcat(np.zeros(2), w, np.zeros(2)), 1, 1)))
    problem.subject_to(z[:, 1:] == A @ z[:, :-1] + B @ w)
    problem.subject_to(z[:, 0] == np.zeros(8))
    problem.subject_to(z[:, n] == np.hstack([SIDES, SIDES, 0, 0, SIDES]))
    problem.subject_to(problem.bounded(-RATE, casadi.vec(w), RATE))
    problem.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    return np.array(problem.solve().value(w)).T


def minimum_jerk() -> np.ndarray:
    """The motors' rates (n, 2) in rad/s on the polynomial of degree 5 with the least jerk."""
    s = np.arange(round(MOVE / STEP) + 1)[:, None] * STEP / MOVE
    return np.asarray(np.diff(SIDES * s**3 * (10 - 15 * s + 6 * s**2), axis=0) / STEP)


def replay(rates: np.ndarray, parameters: dict[str, float] | None = None) -> prw.Run:
    """The FMU's response to motors that turn at these rates and then stop."""
    omega = np.vstack([rates, np.zeros((round(AFTER / STEP) + 1, 2))])
    theta = np.vstack([np.zeros(2), np.cumsum(STEP * omega[:-1], axis=0)])
    return prw.simulate(prw.Motion(np.linspace(0, MOVE + AFTER, len(theta)), theta, omega), parameters)


def left(run: prw.Run) -> float:
    """The largest error of pitch or roll after the move, deg."""
    after = run.time >= MOVE - STEP / 2
    return float(np.rad2deg(max(np.abs(run[name] - goal)[after].max() for name, goal in zip(("pitch", "roll"), GOAL))))


def main() -> tuple[Figure, dict[str, float]]:
    """Find, replay, print and draw; returns the figure, and the largest error after each motion, deg."""
    rates = {"quintic": minimum_jerk(), "smoothest": smoothest()}
    runs = {name: replay(trajectory) for name, trajectory in rates.items()}
    runs["smoothest, k2 10 % less"] = replay(rates["smoothest"], {"k2": 0.9 * runs["smoothest"].parameters["k2"]})
    figure = Figure(figsize=(8, 4.2), layout="constrained")
    axes = figure.subplots(2, 2, sharex=True)
    print("largest error of pitch or roll after the move:")
    for (name, run), style in zip(runs.items(), ("C1-", "C0-", "k:")):
        print(f"  {name:<23} {left(run):.2f} deg")
        for axis, angle in zip(axes[:, 0], ("pitch", "roll")):
            axis.plot(run.time, np.rad2deg(run[angle]), style, label=name)
            axis.set_ylabel(f"{angle} (deg)")
        for axis, trajectory, motor in zip(axes[:, 1], np.diff(run.motion.theta.T) / STEP, (1, 2)):
            axis.step(run.time[:-1], trajectory, style, where="post")
            axis.set_ylabel(f"motor {motor} (rad/s)")
    for axis in axes.flat:
        axis.axvline(MOVE, color="0.6", linewidth=0.8)
    axes[0, 0].legend(frameon=False, fontsize=8)
    figure.supxlabel("time (s)", fontsize=10)
    return figure, {name: left(run) for name, run in runs.items()}


if __name__ == "__main__":
    main()[0].savefig("quiet_motion.png", dpi=110)
