"""Motors with inertia and friction, current and angle loops, coupled to the FMU by their torques

You learn to couple the FMU (`fmu_run.Instances`) with a model of its motors, which takes torques and returns angles and
rates. The output shows how small the communication step must be, since torques are exchanged only between steps.
examples/openmodelica/TorqueDriven.mo has the same motors, loops and move for Model Exchange.

    make examples; .venv/bin/python examples/torque_driven.py
"""

from collections.abc import Callable

import fmu_run
import numpy as np
from matplotlib.figure import Figure

import prw

STEPS = (5e-3, 2e-3, 1e-3, 0.5e-3, 0.25e-3)  # s
FINEST = 62.5e-6  # s
MOVE = 0.6  # s
STEP = np.array([0.2, -0.1])  # motor angles after a step, rad
GOAL = np.deg2rad(
    30 + 4 / 7 * 60 * np.array([1, -1])
)  # motor angles for 30 degrees of pitch and 60 of roll, by eq. (1)
# Assumed data of the motor, because the paper gives none: inertia kg.m2, dry friction N.m and its rate rad/s, damping
# N.m.s/rad, resistance Ohm, inductance H, torque constant N.m/A.
J1, FRICTION, CREEP, DAMPING, R, L, K = 2e-3, 0.05, 0.02, 2e-3, 1.0, 2e-3, 0.5
STIFFNESS, RATE_GAIN = 40.0, 0.6  # angle loop, N.m/rad and N.m.s/rad
PROPORTIONAL, INTEGRAL = 2.0, 1000.0  # current loop, V/A and V/(A.s)


Motion = Callable[[float], tuple[np.ndarray, np.ndarray]]


def jump(time: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles (2,) rad and rates (2,) rad/s that the motors should have if the reference jumps to STEP at time 0."""
    return STEP, np.zeros(2)


def move(time: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles (2,) rad and rates (2,) rad/s that the motors should have on half a cosine to GOAL."""
    phase = np.pi * min(time / MOVE, 1.0)
    return GOAL * (1 - np.cos(phase)) / 2, GOAL * np.pi / (2 * MOVE) * np.sin(phase)


def slope(time: float, x: np.ndarray, tau: np.ndarray, motion: Motion) -> np.ndarray:
    """Derivatives of the drives' states x: angles, rates, currents, integral parts of the current loops; (4, 2)."""
    angle, rate, current, integral = x
    wanted_angle, wanted_rate = motion(time)
    error = (STIFFNESS * (wanted_angle - angle) + RATE_GAIN * (wanted_rate - rate)) / K - current
    voltage = PROPORTIONAL * error + integral
    # tau is added: it is the torque of the wrist on the motor, negative while the motor drives.
    torque = K * current - DAMPING * rate - FRICTION * np.tanh(rate / CREEP) + tau
    return np.array([rate, torque / J1, (voltage - R * current - K * rate) / L, INTEGRAL * error])


def drive(time: float, x: np.ndarray, h: float, tau: np.ndarray, tau_rate: np.ndarray, motion: Motion) -> np.ndarray:
    """The drives' states after a communication step h, in which the torque of the wrist is tau + tau_rate t; Runge-Kutta."""
    steps = max(1, round(h / 2e-4))
    d = h / steps
    for k in range(steps):
        begin, middle, end = (tau + tau_rate * d * (k + part) for part in (0.0, 0.5, 1.0))
        t = time + k * d
        k1 = slope(t, x, begin, motion)
        k2 = slope(t + d / 2, x + d / 2 * k1, middle, motion)
        k3 = slope(t + d / 2, x + d / 2 * k2, middle, motion)
        k4 = slope(t + d, x + d * k3, end, motion)
        x = x + d / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return x


def simulate(h: float, extrapolated: bool, motion: Motion, end: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Couple drives and FMU in communication steps of h s. The torque is held over a step, or follows the line through its last
    two values. Returns the times (n,) s, and tau1, tau2, pitch and roll (n,) by name."""
    times, x, rows = h * np.arange(round(end / h) + 1), np.zeros((4, 2)), []
    with fmu_run.Fmu(prw.default_fmu()) as fmu:
        wrist = fmu.instances(start={"use_omega": True})
        for time in times:
            wrist.set(("theta1", "theta2", "omega1", "omega2"), x[:2].reshape(1, 4))
            rows.append(wrist.get(["tau1", "tau2", "pitch", "roll"])[0])
            tau_rate = (rows[-1][:2] - rows[-2][:2]) / h if extrapolated and len(rows) > 1 else np.zeros(2)
            x = drive(time, x, h, rows[-1][:2], tau_rate, motion)
            wrist.step(h)
    return times, dict(zip(("tau1", "tau2", "pitch", "roll"), np.array(rows).T))


def main() -> tuple[Figure, dict[float, tuple[float, float]]]:
    """Run, print and draw; returns the figure, and the largest error of tau1 after a step of the motors' references, in percent of
    its peak: torque held and extrapolated, by communication step."""
    time, moved = simulate(0.25e-3, True, move, end=1.0)
    print(f"the wrist moves to {np.rad2deg(moved['pitch'][-1]):.3f} and {np.rad2deg(moved['roll'][-1]):.3f} degrees")
    _, exact = simulate(FINEST, True, jump, end=0.4)
    peak, errors = np.abs(exact["tau1"]).max(), {}
    print(
        "largest error of tau1 after a step of the references, torque held over a communication step or extrapolated:"
    )
    for h in STEPS:
        found = [simulate(h, extrapolated, jump, end=0.4)[1]["tau1"] for extrapolated in (False, True)]
        held, extrapolated = (100 * np.abs(each - exact["tau1"][:: round(h / FINEST)]).max() / peak for each in found)
        errors[h] = held, extrapolated
        print(f"{1e3 * h:4g} ms  {held:.1f} %  {f'{extrapolated:.1f} %' if extrapolated < 100 else 'unstable'}")
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    angles, torques = figure.subplots(1, 2)
    for name, colour in (("pitch", "#009E73"), ("roll", "#CC79A7")):
        angles.plot(time, np.rad2deg(moved[name]), color=colour, label=name)
    coarse, held = simulate(STEPS[0], False, jump, end=0.1)
    torques.plot(1e3 * coarse, held["tau1"], ".-", color="0.5", label="tau1 after a step, held over 5 ms")
    torques.plot(1e3 * FINEST * np.arange(len(exact["tau1"])), exact["tau1"], color="#0072B2", label="in small steps")
    angles.set(xlabel="time (s)", ylabel="angle (deg)")
    torques.set(xlabel="time (ms)", ylabel="torque (N.m)", xlim=(0, 100))
    for axes in (angles, torques):
        axes.legend(frameon=False)
    return figure, errors


if __name__ == "__main__":
    main()[0].savefig("torque_driven.png", dpi=110)
