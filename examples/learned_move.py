"""A move with little vibration, learned in 1,024 environments at a time

You learn to create Gymnasium environments from an FMU (`fmu_run.gymnasium`) with random stiffness and load. In each round, 128
candidates are tried on the same eight wrists. The cross-entropy method finds a motor trajectory and feedback gains. The result is
tested on 1,000 other wrists with noisy sensors, and compared with input shapers (ZV, ZVD), which need no sensors.

    make examples; .venv/bin/python examples/learned_move.py
"""

from time import perf_counter

import numpy as np
from fmu_run.gymnasium import Task, VectorEnv
from matplotlib.figure import Figure

import prw

STEP, MOVE, AFTER, GOAL = 2e-3, 0.17, 0.3, np.deg2rad(20)  # s, and rad of pitch
POLE = -9.683 + 34.678j  # of pitch, 1/s: needed by the shapers
VARIED = {"k1": 2.11 * 180 / np.pi, "J3": 1.275e-2, "H3": 4.236e-2}  # Table 1; each varies by 20 % either way
NOISE = {"theta1": 0.0, "pitch": np.deg2rad(0.02), "tau1": 0.02}  # noise of the observed variables, rad and N.m
RATE = 6.0  # limit of the motors, rad/s
WRISTS, HATS, ROUNDS = 8, 8, 150  # wrists per candidate, interpolation points of the motors' trajectory, rounds


def shaped(impulses: int, duration: float) -> np.ndarray:
    """The motors' rates (times,) of a quintic after an input shaper with 1 impulse (no shaper), 2 (ZV) or 3 (ZVD)."""
    half, time = np.pi / POLE.imag, STEP * np.arange(round((duration + AFTER) / STEP) + 1)
    weights = np.atleast_1d(np.poly(np.full(impulses - 1, -np.exp(POLE.real * half))))  # 1; 1, K; 1, 2 K, K2
    s = np.clip((time[:, None] - half * np.arange(impulses)) / (duration - half * (impulses - 1)), 0, 1)
    return np.asarray(np.diff(GOAL * s**3 * (10 - 15 * s + 6 * s**2) @ weights / weights.sum()) / STEP)


def wrists(count: int) -> VectorEnv:
    """Environments of random wrists. Action: rate of both motors. Reward: negative squared error after MOVE."""
    task = Task(
        fmu=prw.default_fmu(),
        actions={"rate": (-RATE, RATE)},
        inputs=("theta1", "theta2", "omega1", "omega2"),
        to_inputs=lambda rate, motors: np.hstack([motors[:, :2] + STEP * motors[:, 2:], rate, rate]),
        observations=tuple(NOISE),
        noise=NOISE,
        reward=lambda before, rate, after: -np.where(envs.steps * STEP > MOVE, (after[:, 1] - GOAL) ** 2, 0),
        step=STEP,
        length=1000,
        failed_reward=-1e6,
        start={"use_omega": True},
        drawn={name: (0.8 * value, 1.2 * value) for name, value in VARIED.items()},
    )
    envs = VectorEnv(task, count)
    return envs


def play(envs: VectorEnv, rates: np.ndarray, gains: np.ndarray, unlike: int, seed: int) -> tuple[np.ndarray, ...]:
    """Pitch (times, n) in deg and the return (n,) of runs with these motors' rates (n, times) and feedback gains (n, 3). Environments with
    the same seed have the same wrist and noise; there are `unlike` different ones."""
    measured, _ = envs.reset(seed=[1000 * seed + k % unlike for k in range(envs.num_envs)])
    wanted, pitch, total = np.zeros(envs.num_envs), [envs.values[:, 1]], np.zeros(envs.num_envs)
    for rate in rates.T:
        errors = np.column_stack([10 * (wanted - measured[:, 0]), 10 * (wanted - measured[:, 1]), measured[:, 2]])
        measured, reward, *_ = envs.step(np.clip(rate + (gains * errors).sum(axis=1), -RATE, RATE)[:, None])
        wanted, total = wanted + STEP * rate, total + reward
        pitch.append(envs.values[:, 1])
    return np.rad2deg(pitch), total


def policy(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rates (n, times) and gains (n, 3) of candidates (n, 3 + HATS)."""
    time, knots = STEP * np.arange(round((MOVE + AFTER) / STEP)), np.linspace(0, MOVE, HATS + 2)
    rates = numbers[:, 3:] @ [np.interp(time, knots, hat) for hat in np.eye(HATS + 2)[1:-1]]
    return rates * GOAL / (STEP * rates.sum(axis=1, keepdims=True)), numbers[:, :3]


def learn(count: int, rounds: int) -> np.ndarray:
    """The parameters of the policy. Each round moves them to the weighted mean of the best quarter of the candidates."""
    envs, rng, candidates = wrists(count), np.random.default_rng(1), count // WRISTS
    middle = np.hstack([[0.5, 0, 0], np.sin(np.linspace(0, np.pi, HATS + 2)[1:-1])])
    spread = np.diag(np.hstack([np.ones(3), np.full(HATS, 0.16)]))
    weights = np.log(candidates / 4 + 0.5) - np.log(np.arange(1, candidates // 4 + 1))
    for seed in range(rounds):
        tried = rng.multivariate_normal(middle, spread, candidates)
        _, total = play(envs, *policy(np.repeat(tried, WRISTS, axis=0)), WRISTS, seed)
        best = tried[np.argsort(-total.reshape(candidates, WRISTS).mean(axis=1))[: candidates // 4]]
        middle = np.average(best, axis=0, weights=weights)
        spread = 0.7 * spread + 0.3 * np.cov(best.T, aweights=weights) + 1e-9 * np.eye(len(middle))
    return np.asarray(middle)


def main(count: int = 1024, rounds: int = ROUNDS, fresh: int = 1000) -> tuple[Figure, dict[str, np.ndarray]]:
    """Learn, test, print and draw; returns the figure, and the remaining vibration (fresh,) by name, deg peak to peak."""
    begun, still = perf_counter(), np.zeros((1, 3))
    learned = policy(learn(count, rounds)[None])
    print(f"learned in {perf_counter() - begun:.0f} s, from {count * rounds:,} moves")
    figure, left, envs = Figure(figsize=(8, 3.6), layout="constrained"), {}, wrists(fresh)
    motions, shares = figure.subplots(1, 2)
    for name, duration, (rates, gains), colour in (
        ("quintic", MOVE, (shaped(1, MOVE)[None], still), "#D55E00"),
        ("ZV", MOVE, (shaped(2, MOVE)[None], still), "#CC79A7"),
        ("learned", MOVE, learned, "#0072B2"),
        ("ZVD, slower", 0.25, (shaped(3, 0.25)[None], still), "#009E73"),
    ):
        pitch, _ = play(envs, np.repeat(rates, fresh, axis=0), np.repeat(gains, fresh, axis=0), fresh, seed=10**6)
        left[name] = np.sort(np.ptp(pitch[round(duration / STEP) :], axis=0))
        mid, p95, most = np.percentile(left[name], [50, 95, 100])
        print(f"{name:<11} in {duration:g} s: median vibration {mid:.2f} deg, 95 % below {p95:.2f}, at most {most:.2f}")
        shares.semilogx(left[name], np.linspace(0, 100, fresh), color=colour, label=f"{name} ({duration:.2f} s)")
        band = np.percentile(pitch, [2.5, 97.5], axis=1)
        motions.fill_between(STEP * np.arange(len(pitch)), *band, color=colour, linewidth=0)
    motions.set(xlabel="time (s)", ylabel="pitch (deg), 95 % of the wrists", xlim=(0.07, MOVE + AFTER), ylim=(12, 27))
    shares.set(xlabel="vibration left, peak to peak (deg)", ylabel="wrists with less (%)", ylim=(0, 100))
    figure.legend(*shares.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    return figure, left


if __name__ == "__main__":
    main()[0].savefig("learned_move.png", dpi=110)
