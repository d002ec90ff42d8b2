"""Predictive control: 1,024 rollouts of a black-box model per decision, or a quadratic program

You learn to plan with an FMU as the model of the plant (MPPI: model predictive path integral control). The state of the
plant is serialized and passed to 1,024 instances (`serialize`, `deserialize`). Each of them tries a different motion of
the motors, and the plant follows a weighted mean of these motions, in which better ones have more weight. This works with
any FMU and any cost. Because the wrist is linear and the cost quadratic, the best motion is also the exact solution of a
quadratic program, which CasADi solves within the limits of the motors. So its error is much smaller.

    make examples; .venv/bin/python examples/predictive_control.py
"""

from time import perf_counter
from typing import Any

import casadi
import control
import numpy as np
from fmu_run import Fmu, Instances
from matplotlib.figure import Figure

import prw

STEP, AHEAD, EACH, LENGTH = 0.01, 16, 0.5, 2.0  # s; number of planned steps; duration of a goal, s; duration, s
GOALS = np.array([(20, 0), (20, 40), (-10, 40), (0, 0)])  # one after the other, pitch and roll, deg
RATE, SPREAD = 6.0, 2.0  # limit of the motors, and standard deviation of the candidates, rad/s
MOTORS, WRIST = ("theta1", "theta2", "omega1", "omega2"), ("pitch", "roll")
STATES = ("theta3", "theta4", "theta5", "theta6", "omega5", "omega6")
TO_SIDES = np.array([[1, 4 / 7], [1, -4 / 7]])  # motor angles per pitch and roll: inverse of eq. (1), M = 4, N = 7


def advance(wrists: Instances, rates: np.ndarray) -> np.ndarray:
    """A step with these rates of the motors (n, 2); returns pitch and roll (n, 2), deg."""
    motors = wrists.get(MOTORS)
    return np.rad2deg(wrists.advance(MOTORS, np.hstack([motors[:, :2] + STEP * motors[:, 2:], rates]), STEP, WRIST))


def planned(wrist: Instances, copies: Instances, goal: np.ndarray, plan: np.ndarray, rng: np.random.Generator) -> Any:
    """A better plan, the motors' rates (AHEAD, 2): the mean of the candidates, with weights that fall with the cost."""
    state = [found for found in wrist.serialize(wrist.save()) if found is not None]
    copies.restore(copies.deserialize(state * len(copies)))
    between = [np.interp(np.arange(AHEAD), np.linspace(0, AHEAD - 1, 6), knot) for knot in np.eye(6)]
    spread = SPREAD * rng.choice([0.1, 0.3, 1], (len(copies), 1, 1))
    tried = np.clip(
        plan + spread * np.einsum("nkm,kt->ntm", rng.normal(size=(len(copies), 6, 2)), between), -RATE, RATE
    )
    tried[0] = plan
    cost = 2e-3 * (np.diff(tried, axis=1) ** 2).sum(axis=(1, 2))
    for rates in tried.swapaxes(0, 1):
        cost += ((advance(copies, rates) - goal) ** 2).sum(axis=1)
    weights = np.exp(-(cost - cost.min()) / (0.3 * np.std(np.sort(cost)[: len(copies) // 20]) + 1e-9))
    return np.average(tried, axis=0, weights=weights)


def program(ahead: int = 2 * AHEAD) -> casadi.Function:
    """The quadratic program: a function of the states and the motors' angles (8,), of the last rates of the motors and of the goal, (2,)
    each in SI, which returns the best rates (2,)."""
    model = prw.linearize(outputs=WRIST)
    (angles, turning), zero = np.hsplit(model.B, 2), np.zeros
    # Motors turn at a constant rate during a step, so their angles are states.
    wrist = control.ss(
        np.block([[model.A, angles], [zero((2, 8))]]), np.vstack([turning, np.eye(2)]), np.eye(8), zero((8, 2))
    )
    held, opti = control.c2d(wrist, STEP), casadi.Opti("conic")
    rates, (begin, last, goal) = opti.variable(2, ahead), map(opti.parameter, (8, 2, 2))
    state, cost = begin, 1e-4 * casadi.sumsqr(rates - casadi.horzcat(last, rates[:, :-1]))
    for k in range(ahead):
        state = held.A @ state + held.B @ rates[:, k]
        cost += casadi.sumsqr(np.rad2deg(1) * (model.C @ state[:6] - goal))
    opti.minimize(cost)
    opti.subject_to(opti.bounded(-RATE, casadi.vec(rates), RATE))
    opti.solver("daqp")
    return opti.to_function("plan", [begin, last, goal], [rates[:, 0]])


def follow(name: str, fmu: Fmu, rollouts: int, length: float) -> tuple[np.ndarray, np.ndarray]:
    """Goals, and pitch and roll, (times, 2) each in deg. The motors move directly to the angles of the goal ("straight"),
    or as the rollouts ("planned") or the quadratic program ("program") find best."""
    wrist, copies = fmu.instances(start={"use_omega": True}), fmu.instances(rollouts, threads=None)
    rng, plan, best, rows = np.random.default_rng(1), np.zeros((AHEAD, 2)), program(), []
    for k in range(round(length / STEP)):
        goal = GOALS[int(k * STEP / EACH) % len(GOALS)]
        motors = wrist.get(MOTORS)[0]
        angles = motors[:2] + STEP * motors[2:]
        if name == "planned":
            plan = planned(wrist, copies, goal, np.vstack([plan[1:], np.zeros(2)]), rng)
        elif name == "program":
            plan = np.array(best(np.hstack([wrist.get(STATES)[0], angles]), motors[2:], np.deg2rad(goal))).T
        else:
            plan = np.clip((TO_SIDES @ np.deg2rad(goal) - angles) / STEP, -RATE, RATE)[None]
        rows.append((goal, advance(wrist, plan[:1])[0]))
    return tuple(np.array(rows).swapaxes(0, 1))


def main(rollouts: int = 1024, length: float = LENGTH) -> tuple[Figure, dict[str, np.ndarray]]:
    """Control, print and draw; returns the figure, and the errors of pitch and roll (times, 2) by name, deg."""
    figure, errors, rates = Figure(figsize=(8, 3.2), layout="constrained"), {}, {}
    axes = figure.subplots(1, 2, sharex=True)
    with Fmu(prw.default_fmu()) as fmu:
        for name, colour in (("straight", "#D55E00"), ("planned", "#0072B2"), ("program", "#009E73")):
            begun = perf_counter()
            goal, wrist = follow(name, fmu, rollouts, length)
            rates[name], errors[name] = len(goal) / (perf_counter() - begun), wrist - goal
            since = np.arange(len(goal)) * STEP % EACH
            worst = np.abs(errors[name][since > 0.2]).max()
            print(f"{name:<8} largest error from 0.2 s after each change of the goal: {worst:.3f} deg")
            for axis, trajectory, title in zip(axes, wrist.T, WRIST):
                axis.plot(STEP * np.arange(1, len(goal) + 1), trajectory, color=colour, label=name)
                axis.set(title=title, xlabel="time (s)", ylabel="angle (deg)")
    print(f"{rates['planned']:.0f} decisions per second, {rollouts} rollouts of {AHEAD} steps each")
    print(f"{rates['program']:.0f} decisions per second, quadratic program")
    since = STEP * np.arange(len(goal))
    for axis, trajectory in zip(axes, goal.T):
        axis.step(since, trajectory, "--", color="0.5", where="post", linewidth=1, label="goal", zorder=0)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure, errors


if __name__ == "__main__":
    main()[0].savefig("predictive_control.png", dpi=110)
