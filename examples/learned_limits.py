"""A controller for motors with limits, learned in 1,024 environments at a time, against the best LQR

You learn to train a controller on a `Task` (`fmu_run.gymnasium`) with goals that are drawn, noisy sensors and random wrists.
Because the motors have limits, no linear controller is the best one. So a network of 8 neurons is added to an LQR and trained
by the cross-entropy method. On 1,000 other goals and wrists it arrives earlier than with any weights of the LQR.

    make examples; .venv/bin/python examples/learned_limits.py
"""

from time import perf_counter

import control
import numpy as np
from fmu_run.gymnasium import Task, VectorEnv
from matplotlib.figure import Figure

import prw

STEP, LENGTH, CLOSE = 0.01, 60, np.deg2rad(2)  # s, steps, rad
ACCELERATION, RATE = 30.0, 6.0  # limits of the motors, rad/s2 and rad/s
TO_SIDES = np.array([[1, 4 / 7], [1, -4 / 7]])  # motor angles per pitch and roll: inverse of eq. (1), M = 4, N = 7
NOISE = dict.fromkeys(("theta3", "theta4", "pitch", "roll"), float(np.deg2rad(0.02)))  # standard deviation, rad
NEURONS, EPISODES, ROUNDS = 8, 8, 50  # neurons, episodes for each candidate, rounds


def limited(action: np.ndarray, motors: np.ndarray) -> np.ndarray:
    """Angles and rates of the motors (n, 4), with their accelerations / ACCELERATION, (n, 2), as action."""
    rates = np.clip(motors[:, 2:] + STEP * ACCELERATION * np.clip(action, -1, 1), -RATE, RATE)
    return np.hstack([motors[:, :2] + STEP * motors[:, 2:], rates])


TASK = Task(
    fmu=prw.default_fmu(),
    actions={"acceleration1": (-1.0, 1.0), "acceleration2": (-1.0, 1.0)},
    inputs=("theta1", "theta2", "omega1", "omega2"),
    to_inputs=limited,
    observations=("theta1", "theta2", "omega1", "omega2", *NOISE, "pitch_rate", "roll_rate"),
    noise=NOISE,
    goals={"pitch_goal": (-0.7, 0.7), "roll_goal": (-1.0, 1.0)},  # rad
    # Minus the time, s, that pitch or roll is away from the goal: a step, but less if they are closer than CLOSE.
    reward=lambda _, action, after: -STEP * np.minimum(np.abs(after[:, 6:8] - after[:, 10:]).max(axis=1) / CLOSE, 1),
    step=STEP,
    length=LENGTH,
    failed_reward=-10.0,
    start={"use_omega": True},
    drawn={"k1": (97.0, 145.0), "H3": (0.034, 0.051)},
)


def lqr(weight: float) -> np.ndarray:
    """Feedback (2, 10) of the states and of the motors' angles and rates; weight: of the accelerations."""
    model = prw.linearize(outputs=("pitch", "roll"))
    (angles, rates), zero = np.hsplit(model.B, 2), np.zeros
    states = np.block([[model.A, angles], [zero((2, 8))]])
    held = control.c2d(control.ss(states, np.vstack([rates, np.eye(2)]), np.eye(8), zero((8, 2))), STEP)
    A = np.block([[held.A, held.B], [zero((2, 8)), np.eye(2)]])
    error = np.hstack([model.C, zero((2, 4))])
    return np.asarray(control.dlqr(A, STEP * A[:, 8:], error.T @ error + 1e-6 * np.eye(10), weight * np.eye(2))[0])


def play(envs: VectorEnv, gains: np.ndarray, networks: np.ndarray, seeds: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """Time away from the goal (n,) in s, and pitch and roll (times, n, 2) in deg. networks: (n, 6 * NEURONS), for both axes."""
    observed, _ = envs.reset(seed=seeds)
    inner, outer = networks[:, : 5 * NEURONS].reshape(-1, 5, NEURONS), networks[:, 5 * NEURONS :]
    total, angles = np.zeros(len(seeds)), np.empty((LENGTH, len(seeds), 2))
    for k in range(LENGTH):
        goal, sides, rates = (observed[:, i : i + 2] @ TO_SIDES.T for i in (10, 6, 8))
        turned = observed[:, :2] + STEP * observed[:, 2:4] - goal
        away = np.hstack([observed[:, 4:6] - goal, sides - goal, rates, turned, observed[:, 2:4]])
        both = away.reshape(-1, 5, 2) @ [[0.5, 0.5], [0.5, -0.5]]
        added = (np.tanh(np.einsum("nfs,nfk->nsk", both, inner)) * outer[:, None]).sum(axis=2) @ [[1, 1], [1, -1]]
        observed, rewards, *_ = envs.step(added - away @ gains.T / ACCELERATION)
        total, angles[k] = total - rewards, np.rad2deg(envs.values[:, 6:8])
    return total, angles


def learn(gains: np.ndarray, count: int, rounds: int) -> tuple[np.ndarray, list[float]]:
    """The network, and the mean time of each round. A round moves it to the weighted mean of the best quarter of the candidates."""
    envs, rng, candidates = VectorEnv(TASK, count), np.random.default_rng(1), count // EPISODES
    middle = np.hstack([rng.normal(0, 1, 5 * NEURONS), np.zeros(NEURONS)])  # no effect at first
    spread, means = np.diag(np.repeat([0.25, 0.09], [5 * NEURONS, NEURONS])), []
    weights = np.log(candidates / 4 + 0.5) - np.log(np.arange(1, candidates // 4 + 1))
    for number in range(rounds):
        tried = rng.multivariate_normal(middle, spread, candidates)
        seeds = (EPISODES * number + np.arange(count) % EPISODES).tolist()
        total, _ = play(envs, gains, np.repeat(tried, EPISODES, axis=0), seeds)
        means.append(float(total.mean()))
        best = tried[np.argsort(total.reshape(candidates, EPISODES).mean(axis=1))[: candidates // 4]]
        middle = np.average(best, axis=0, weights=weights)
        spread = 0.7 * spread + 0.3 * np.cov(best.T, aweights=weights) + 1e-9 * np.eye(len(middle))
    return np.asarray(middle), means


def main(count: int = 1024, rounds: int = ROUNDS, fresh: int = 1000) -> tuple[Figure, dict[str, np.ndarray]]:
    """Learn, test, print and draw; returns the figure, and the time away from the goal (fresh,) in s by name."""
    envs, none, begun = VectorEnv(TASK, fresh), np.zeros((fresh, 6 * NEURONS)), perf_counter()
    seeds, linear = list(range(10**6, 10**6 + fresh)), [lqr(weight) for weight in np.geomspace(1e-6, 1e-4, 9)]
    tried = [play(envs, gains, none, seeds) for gains in linear]
    best = int(np.argmin([total.mean() for total, _ in tried]))
    network, means = learn(linear[best], count, rounds)
    print(f"learned in {perf_counter() - begun:.0f} s, from {count * rounds:,} moves")
    found = {"best LQR": tried[best], "learned": play(envs, linear[best], none + network, seeds)}
    curve, shares, move = (figure := Figure(figsize=(8, 3.2), layout="constrained")).subplots(1, 3)
    curve.plot(np.arange(rounds), means, color="#0072B2")
    curve.axhline(tried[best][0].mean(), color="#D55E00")
    far = int(np.argmax(found["best LQR"][0] - found["learned"][0]))
    for (name, (total, angles)), colour in zip(found.items(), ("#D55E00", "#0072B2")):
        print(f"{name:<8} away for {total.mean():.3f} s on average, 95 % below {np.percentile(total, 95):.3f} s")
        shares.ecdf(total, color=colour, label=name)
        move.plot(STEP * np.arange(1, LENGTH + 1), angles[:, far], color=colour)
    curve.set(xlabel="round", ylabel="mean time away from the goal (s)")
    shares.set(xlabel="time away from the goal (s)", ylabel="share of the goals")
    move.set(xlabel="time (s)", ylabel="pitch and roll (deg)")
    figure.legend(*shares.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    return figure, {name: total for name, (total, _) in found.items()}


if __name__ == "__main__":
    main()[0].savefig("learned_limits.png", dpi=110)
