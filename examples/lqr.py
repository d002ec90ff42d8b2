"""LQR and Kalman filter for the wrist, against the PI controller

You learn to linearize the FMU (`prw.linearize`) and to design a state feedback and a Kalman filter with python-control.
The loop is closed around the FMU, sample by sample, with noisy encoders. The PI controller uses neither a model of the
couplings nor the rate of the reference, so its errors are more than 20 times as large. Feedback is only a part of this: the
load of the moving wrist twists the couplings, so the motors have to be ahead of the wrist by this twist. The example
calculates their motion with the inverse of the model. Wanting the angles of an untwisted wrist would leave about 1 degree.

    make examples; .venv/bin/python examples/lqr.py
"""

from typing import Any

import control
import numpy as np
from fmu_run import Fmu, Instances
from matplotlib.figure import Figure

import prw

STEP, STEPS = 1e-3, 3000  # s
NOISE = np.deg2rad(0.02)  # standard deviation of the encoders of pitch and roll, rad
ACCELERATION = 30.0  # limit of the motors, equal to the limit of the PI controller, rad/s2
MOTORS = ("theta1", "theta2", "omega1", "omega2")
TO_SIDES = np.array([[1, 4 / 7], [1, -4 / 7]])  # motor angles per pitch and roll: inverse of eq. (1), M = 4, N = 7


def design() -> tuple[np.ndarray, ...]:
    """The sampled model z+ = A z + B a, y = C z (z: states, motors' angles and rates; a: accelerations), and the gains of
    the feedback and of the filter."""
    model = prw.linearize(outputs=("pitch", "roll"))
    (angles, rates), zero, one = np.hsplit(model.B, 2), np.zeros, np.eye(2)
    # Motors turn at a constant rate during a sample, so the angles are states and the rates are inputs.
    wrist = control.ss(np.block([[model.A, angles], [zero((2, 8))]]), np.vstack([rates, one]), np.eye(8), zero((8, 2)))
    held = control.c2d(wrist, STEP)
    A = np.block([[held.A, held.B], [zero((2, 8)), one]])
    B = STEP * A[:, 8:]  # an acceleration changes the rate at the start of a sample
    C = np.block([[model.C, zero((2, 4))], [zero((2, 6)), one, zero((2, 2))]])
    # The cost of an error of one degree equals the cost of an acceleration of 30 rad/s2.
    weight = C[:2].T @ C[:2] / np.deg2rad(1) ** 2 + 1e-6 * np.eye(10)
    feedback, *_ = control.dlqr(A, B, weight, np.eye(2) / ACCELERATION**2)
    gain, *_ = control.dlqe(A, B, C, 0.5 * np.eye(2), np.diag([NOISE, NOISE, 1e-5, 1e-5]) ** 2)
    return A, B, C, np.asarray(feedback), np.asarray(gain)


def wanted(angle: np.ndarray) -> np.ndarray:
    """States and motors' angles and rates (n, 10) with which the wrist, whose load twists the couplings, follows `angle`."""
    model = prw.linearize()
    side = angle @ TO_SIDES.T  # theta5 and theta6
    rate = np.gradient(side, STEP, axis=0)
    known = np.hstack([side, rate, np.gradient(rate, STEP, axis=0)])
    # Eq. (11), solved for the motors' rates, is the inverse of the model. Its states are theta3, theta4, theta1 and theta2.
    load = np.linalg.inv(model.B[4:, 2:])
    rates = load @ np.hstack([-model.A[4:, :2], -model.B[4:, :2]]), load @ np.hstack([-model.A[4:, 2:], np.eye(2)])
    A = np.vstack([np.hstack([model.A[:2, :2], model.B[:2, :2]]) + model.B[:2, 2:] @ rates[0], rates[0]])
    B = np.vstack([np.hstack([model.A[:2, 2:], np.zeros((2, 2))]) + model.B[:2, 2:] @ rates[1], rates[1]])
    inverse = control.ss(A, B, np.vstack([np.eye(4), rates[0]]), np.vstack([np.zeros((4, 6)), rates[1]]))
    found = control.forced_response(inverse, STEP * np.arange(len(angle)), known.T).outputs.T
    return np.hstack([found[:, :2], side, rate, found[:, 2:]])


def follow(controller: Any, noise: np.ndarray) -> np.ndarray:
    """Pitch and roll (n, 2) in rad of the FMU with a controller that calculates the motion of the motors from measurements."""
    rows = []
    next(controller)  # runs to the first measurement
    with Fmu(prw.default_fmu()) as fmu:
        testbed = fmu.instances(start={"use_omega": True})
        for k in range(STEPS):
            rows.append(testbed.get(("pitch", "roll"))[0])
            testbed.set(MOTORS, controller.send((k, rows[-1] + noise[k])))
            testbed.step(STEP)
    return np.array(rows)


def lqr(angle: np.ndarray) -> Any:
    """The wanted motion of the motors, and state feedback of the estimate of the Kalman filter."""
    A, B, C, feedback, gain = design()
    goal = wanted(angle)
    ahead = np.gradient(goal[:, 8:], STEP, axis=0)  # the motors' accelerations
    estimate, motor, turning, motion = np.zeros(10), np.zeros(2), np.zeros(2), None
    while True:
        k, measured = yield motion
        estimate = estimate + gain @ (np.hstack([measured, motor]) - C @ estimate)
        asked = turning + STEP * np.clip(ahead[k] + feedback @ (goal[k] - estimate), -ACCELERATION, ACCELERATION)
        estimate = A @ estimate + B @ (asked - turning) / STEP
        motion, motor, turning = (*motor, *asked), motor + STEP * asked, asked


def pi(controller: Instances, angle: np.ndarray) -> Any:
    """The controller FMU, which gets the reference at each sample and does not use its rate."""
    motion = None
    while True:
        k, measured = yield motion
        motion = controller.get(MOTORS)[0]
        controller.set(("pitch", "roll", "pitch_ref", "roll_ref"), (*measured, *angle[k]))
        controller.step(STEP)


def main() -> tuple[Figure, dict[str, np.ndarray]]:
    """Follow waves of pitch and roll with both, print and draw; returns the figure, and the errors (n, 2) in rad."""
    time = STEP * np.arange(STEPS)
    angle = np.deg2rad([30, 50]) * np.sin(np.pi * np.outer(time, [0.9, 0.6])) ** 2
    noise = np.random.default_rng(1).normal(0, NOISE, (STEPS, 2))
    with Fmu(prw.default_fmu().with_name("prw_controller.fmu")) as fmu:
        errors = {"PI": follow(pi(fmu.instances(), angle), noise) - angle, "LQR": follow(lqr(angle), noise) - angle}
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    axes = figure.subplots(1, 2, sharex=True)
    for (name, error), colour in zip(errors.items(), ("#D55E00", "#0072B2")):
        rms = np.rad2deg(np.sqrt(np.mean(error**2, axis=0)))
        print(f"{name:<4} pitch {rms[0]:.2f} deg, roll {rms[1]:.2f} deg (root mean square of the error)")
        for axis, trajectory, title in zip(axes, np.rad2deg(error).T, ("pitch", "roll")):
            axis.plot(time, trajectory, color=colour, label=name)
            axis.set(title=title, xlabel="time (s)", ylabel="error (deg)")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    return figure, errors


if __name__ == "__main__":
    main()[0].savefig("lqr.png", dpi=110)
