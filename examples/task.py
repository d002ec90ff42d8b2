"""A task for an agent: pitch a random wrist to a random goal, in 1,024 environments at a time

You learn to make Gymnasium environments from an FMU with a `Task` (`fmu_run.gymnasium`): goals and parameters that are drawn
for each episode, sensors with noise and delay, and a reward that uses exact values. `Env(TASK)` is one environment for any
library, such as Stable-Baselines3; a `VectorEnv` steps all of them in one call. In place of an agent, this example tries
feedback gains. All gains meet the same wrists and goals, because their environments have the same seeds.

    make examples; .venv/bin/python examples/task.py
"""

import numpy as np
from fmu_run.gymnasium import Task, VectorEnv
from matplotlib.figure import Figure

import prw

STEP, LENGTH, RATE = 0.01, 60, 6.0  # s, steps, rad/s
GAINS = (2.0, 4.0, 8.0, 16.0)  # 1/s


def to_inputs(action: np.ndarray, motors: np.ndarray) -> np.ndarray:
    """Angles and rates of the motors (n, 4), with the rate of both / RATE, (n, 1), as action."""
    rate = RATE * np.clip(action, -1, 1)
    return np.hstack([motors[:, :2] + STEP * motors[:, 2:], rate, rate])


TASK = Task(
    fmu=prw.default_fmu(),
    actions={"rate": (-1.0, 1.0)},
    inputs=("theta1", "theta2", "omega1", "omega2"),
    to_inputs=to_inputs,
    observations=("theta1", "pitch", "pitch_rate", "tau1"),
    goals={"goal": (0.2, 0.5)},  # rad; the agent observes it after the observations
    noise={"pitch": 3e-4, "tau1": 0.02},  # standard deviations, rad and N.m
    delays={"tau1": 2, "rate": 1},  # steps
    # The columns are the exact observations, then the goal.
    reward=lambda before, action, after: -np.abs(after[:, 1] - after[:, 4]) - 0.01 * action[:, 0] ** 2,
    step=STEP,
    length=LENGTH,
    failed_reward=-1000.0,  # worse than the rest of any episode
    start={"use_omega": True},
    drawn={"k1": (97.0, 145.0), "H3": (0.034, 0.051)},
)


def play(envs: VectorEnv, gains: np.ndarray, seeds: list[int]) -> tuple[np.ndarray, np.ndarray]:
    """The return (n,) of an episode of each environment, and the distance from the goal (LENGTH, n) in deg. gains: (n,) 1/s."""
    observed, _ = envs.reset(seed=seeds)
    total, away = np.zeros(len(seeds)), np.empty((LENGTH, len(seeds)))
    for k in range(LENGTH):
        observed, rewards, *_ = envs.step((gains * (observed[:, 4] - observed[:, 1]) / RATE)[:, None])
        total, away[k] = total + rewards, np.rad2deg(envs.values[:, 4] - envs.values[:, 1])
    return total, away


def main(count: int = 1024) -> tuple[Figure, dict[float, np.ndarray]]:
    """Try the gains, print and draw; returns the figure, and the returns by gain."""
    each = count // len(GAINS)
    total, away = play(VectorEnv(TASK, count), np.repeat(GAINS, each), list(range(each)) * len(GAINS))
    returns = dict(zip(GAINS, total.reshape(len(GAINS), each)))
    for gain, found in returns.items():
        print(
            f"gain {gain:4g} 1/s: return {found.mean():.2f} on average, {found.min():.2f} in the worst of {each} episodes"
        )
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    for gain, axes, columns in zip(
        GAINS, figure.subplots(1, len(GAINS), sharey=True), np.split(away, len(GAINS), axis=1)
    ):
        axes.plot(STEP * np.arange(1, LENGTH + 1), columns[:, :20], color="#009E73", linewidth=0.6)
        axes.set(title=f"{gain:g} 1/s", xlabel="time (s)")
    figure.axes[0].set_ylabel("goal minus pitch (deg)")
    return figure, returns


if __name__ == "__main__":
    main()[0].savefig("task.png", dpi=110)
