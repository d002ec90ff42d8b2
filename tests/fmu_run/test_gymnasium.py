"""Compares Gymnasium environments with instances that the test steps."""

from __future__ import annotations

import runpy
import subprocess
import sys
import warnings
from dataclasses import replace

import fmu_run
import gymnasium
import numpy as np
import pytest
from built import ROOT, built
from fmu_run.gymnasium import AutoresetMode, Env, Task, VectorEnv
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import SyncVectorEnv

MOTORS, OBSERVED, STEP = ("theta1", "theta2"), ("pitch", "roll", "tau1"), 2e-3


def effort(before, action, after):
    return -np.abs(after[:, 0] - 0.1) - 0.01 * (action**2).sum(axis=1) - (after[:, 1] - before[:, 1]) ** 2


@pytest.fixture
def task(testbed) -> Task:
    return Task(
        fmu=testbed,
        actions=dict.fromkeys(MOTORS, (-1.0, 1.0)),
        observations=dict.fromkeys(OBSERVED, (-50.0, 50.0)),
        reward=effort,
        step=STEP,
        length=20,
        failed_reward=-100.0,
        drawn={"k1": (100.0, 140.0), "J3": lambda rng: 0.0127 * rng.lognormal(0.0, 0.1)},
    )


def play_randomly(envs, steps, seed=5):
    """Plays random actions, and returns the observations, rewards and ends of episodes."""
    envs.action_space.seed(seed)
    found = [envs.reset(seed=seed)[0]]
    for _ in range(steps):
        found += envs.step(envs.action_space.sample())[:4]
    return found


def same(one, other) -> bool:
    return len(one) == len(other) and all(np.array_equal(a, b) for a, b in zip(one, other))


def test_importing_fmu_run_needs_no_gymnasium() -> None:
    program = "import sys, fmu_run; sys.exit('gymnasium' in sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)


def test_gymnasium_reports_no_fault(task) -> None:
    gymnasium.register("Wrist-v0", Env, vector_entry_point=VectorEnv, kwargs={"task": task})
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with gymnasium.make("Wrist-v0") as env:
                check_env(env.unwrapped)
            envs = gymnasium.make_vec("Wrist-v0", num_envs=3)
            assert isinstance(envs, VectorEnv) and envs.num_envs == 3
            assert envs.reset()[0] in envs.observation_space
            envs.close()
    finally:
        del gymnasium.registry["Wrist-v0"]


def test_a_system_is_an_environment_with_the_bounds_of_its_description(task) -> None:
    loop = replace(
        task,
        fmu=built("prw_closed_loop.ssp"),
        actions="pitch_ref",
        observations=["roll", "testbed.k1", "controller.Kp"],
        drawn={"testbed.k1": (100.0, 140.0)},
    )
    envs = VectorEnv(loop, 3)
    assert envs.single_observation_space.low[2] == 0.0 and envs.single_observation_space.high[2] == 1e9
    first, begun = envs.reset(seed=4)
    assert np.array_equal(begun["drawn"]["testbed.k1"], first[:, 1]) and begun["_drawn"].all()
    for _ in range(15):
        observed, _, _, _, infos = envs.step(np.full((3, 1), 0.2))
    assert (observed[:, 0] > 1e-4).all() and infos == {} and np.array_equal(observed[:, 1], first[:, 1])
    assert len(set(observed[:, 1])) == 3
    envs.close()


@pytest.mark.parametrize("mode", AutoresetMode)
def test_environments_equal_instances(task, mode) -> None:
    """Results are bit-identical, also in later episodes, if the parameters come from a random generator with the same seed."""
    count, envs = 4, VectorEnv(task, 4, autoreset_mode=mode)
    rngs, actions = (
        [np.random.default_rng(3 + k) for k in range(4)],
        np.random.default_rng(4).uniform(-1, 1, (50, count, 2)),
    )

    def begin_episode():
        each = [(rng.uniform(100.0, 140.0), 0.0127 * rng.lognormal(0.0, 0.1)) for rng in rngs]
        drawn = dict(zip(("k1", "J3"), np.array(each).T))
        wrists.reset(start=drawn)
        assert np.array_equal(envs._instances.get(("k1", "J3")).T, [*drawn.values()])
        return wrists.get(OBSERVED)

    with fmu_run.Fmu(task.fmu) as fmu:
        wrists = fmu.instances(count)
        observed, _ = envs.reset(seed=3)
        expected, k = begin_episode(), 0
        assert np.array_equal(observed, expected)
        for action in actions:
            observed, rewards, terminated, truncated, infos = envs.step(action)
            renewed = k == task.length if mode is AutoresetMode.NEXT_STEP else k == task.length - 1
            if mode is not AutoresetMode.DISABLED and renewed:
                assert np.array_equal(infos["drawn"]["k1"], envs._instances.get("k1"))
            if k == task.length and mode is AutoresetMode.NEXT_STEP:
                expected, k = begin_episode(), 0
                assert not (rewards.any() or truncated.any())
            else:
                before, k = expected, k + 1
                wrists.set(MOTORS, action)
                wrists.step(STEP)
                expected = wrists.get(OBSERVED)
                assert np.array_equal(rewards, effort(before, action, expected))
                assert truncated.all() == truncated.any() == (k == task.length)
            if k == task.length and mode is AutoresetMode.SAME_STEP:
                assert infos["_final_obs"].all() and same(infos["final_obs"], expected)
                expected, k = begin_episode(), 0
            elif k == task.length and mode is AutoresetMode.DISABLED:
                with pytest.raises(gymnasium.error.ResetNeeded, match=r"\[0, 1, 2, 3\] are over"):
                    envs.step(action)
                assert np.array_equal(observed, expected)
                observed, _ = envs.reset(options={"reset_mask": np.ones(count, dtype=bool)})
                expected, k = begin_episode(), 0
            assert np.array_equal(observed, expected) and not terminated.any()
            observed[:] = np.nan  # The caller owns the array, so overwriting it must not affect the environments.
    envs.close()
    with pytest.raises(fmu_run.FmuError, match="closed"):
        envs._own.instances()


SENSED = {
    "observations": dict.fromkeys(OBSERVED, (-50.0, 50.0)),
    "privileged": ("theta3",),
    "goals": {"goal": (0.1, 0.2), "other": lambda rng: rng.normal()},
    "noise": {"roll": 0.01, "tau1": 0.1},
    "delays": {"tau1": 3, "theta1": 2},
    "reward": lambda before, action, after: -np.abs(after[:, 0] - after[:, 3]) - after[:, 5] ** 2 - before[:, 1] ** 2,
    "length": 100,
}


@pytest.mark.parametrize("mode", AutoresetMode)
def test_noise_delays_goals_and_privileged_variables(task, mode) -> None:
    """The reward has the exact values; the agent's ones are late, and their noise is new in each step, episode and environment."""
    plain = replace(task, **SENSED, drawn={})
    seen, exact = (VectorEnv(each, 3, autoreset_mode=mode) for each in (plain, replace(plain, noise={}, delays={})))
    (observed, _), (truth, _) = seen.reset(seed=2), exact.reset(seed=2)
    assert seen.single_observation_space.shape == (5,) and np.array_equal(observed[:, 3:], truth[:, 3:])
    assert ((truth[:, 3] > 0.1) & (truth[:, 3] < 0.2)).all() and len({*truth[:, 3], *truth[:, 4]}) == 6
    actions, late = np.random.default_rng(1).uniform(-1, 1, (100, 3, 2)), np.zeros(2)
    differences, truths = [observed - truth], [truth]
    for k, action in enumerate(actions):
        before = exact.values
        observed, reward, *_, infos = seen.step(action)
        late = np.stack([actions[k - 2, :, 0] if k >= 2 else np.zeros(3), action[:, 1]], axis=1)
        truth, *_, true_infos = exact.step(late)
        if k == 99 and mode is AutoresetMode.SAME_STEP:
            assert (seen.steps == 0).all() and not np.array_equal(observed[:, 3:], differences[0][:, 3:])
            observed, truth = np.stack(infos["final_obs"]), np.stack(true_infos["final_obs"])
        else:
            assert np.array_equal(seen.values, exact.values) and np.array_equal(exact.values[:, :5], truth)
            assert np.array_equal(reward, SENSED["reward"](before, action, exact.values))
        truths.append(truth)
        delayed = np.column_stack([truth[:, :2], truths[max(k + 1 - 3, 0)][:, 2], truth[:, 3:]])
        differences.append(observed - delayed)
    noise = np.array(differences)
    assert not noise[:, :, [0, 3, 4]].any()
    assert noise.std(axis=(0, 1))[[1, 2]] == pytest.approx([0.01, 0.1], rel=0.15)
    assert np.abs(np.corrcoef(noise[:, :, 1:3].reshape(101, 6).T) - np.eye(6)).max() < 0.35


def test_a_late_action(task) -> None:
    late, exact = (VectorEnv(replace(task, delays=delays), 2) for delays in ({"theta1": 1}, {}))
    assert np.array_equal(late.reset(seed=1)[0], exact.reset(seed=1)[0])
    for applied in (0.0, 0.3, 0.3):
        assert np.array_equal(late.step(np.full((2, 2), [0.3, 0.0]))[0], exact.step(np.full((2, 2), [applied, 0.0]))[0])


def test_draws_do_not_depend_on_the_number_of_environments(task) -> None:
    """Also in later episodes. A list of seeds selects the draws of each environment, and a mask those that begin anew."""
    actions = np.random.default_rng(1).uniform(-1, 1, (150, 64, 2))

    def play(count, seed, which=None):
        envs = VectorEnv(replace(task, **SENSED), count)
        found = [envs.reset(seed=seed)[0]]
        for action in actions:
            found += envs.step(action[which or slice(count)])[:2]
        return found

    few, many = play(8, 5), play(64, 5)
    assert same(few, [values[:8] for values in many]) and not same(few, play(8, 6))
    swapped = play(8, list(range(12, 4, -1)), slice(7, None, -1))
    assert same(few, [values[::-1] for values in swapped])
    envs = VectorEnv(replace(task, **SENSED), 2)
    first, _ = envs.reset(seed=[1, 1])
    assert np.array_equal(first[0], first[1])
    second, _ = envs.reset(seed=np.array([1, 1]), options={"reset_mask": np.array([True, False])})
    assert np.array_equal(second, first)
    third, _ = envs.reset(seed=[None, 1])
    assert not np.array_equal(third[0], first[0]) and np.array_equal(third[1], first[1])
    with pytest.raises(ValueError, match="seed must have one number for each of 2 environments, it has 1"):
        envs.reset(seed=[1])


def test_env_equals_vector_env_and_seeds_are_reproducible(task) -> None:
    one, many = play_randomly(SyncVectorEnv([lambda: Env(task)] * 3), 50), play_randomly(VectorEnv(task, 3), 50)
    assert same(one, many)
    assert same(many, play_randomly(VectorEnv(task, 3), 50))
    assert not same(many, play_randomly(VectorEnv(task, 3), 50, seed=6))


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize("count", [1, 3])
def test_a_failure_ends_one_episode(task, mode, count) -> None:
    envs = VectorEnv(replace(task, failed_reward=-7.0), count, autoreset_mode=mode)
    other = VectorEnv(task, count, autoreset_mode=mode)
    bad, last = np.zeros((count, 2)), np.arange(count) == count - 1
    for each in (envs, other):
        each.reset(seed=1)
        observed, *_ = each.step(bad + 0.1)
    bad[-1, 0] = np.nan
    after, rewards, terminated, _, infos = envs.step(bad)
    expected, good, *_ = other.step(np.nan_to_num(bad))
    assert np.array_equal(terminated, last)
    assert np.array_equal(after[:-1], expected[:-1]) and np.array_equal(rewards[:-1], good[:-1]) and rewards[-1] == -7.0
    if mode == "SameStep":
        assert np.array_equal(infos["_final_info"], last) and envs.steps[-1] == 0
        final, infos = infos["final_obs"][-1], infos["final_info"]
    else:
        final = after[-1]
    assert np.array_equal(final, observed[-1]), "the final observation must be the one before the failure"
    assert np.array_equal(infos["_error"], last) and "theta1" in infos["error"][-1]
    if mode == "Disabled":
        envs.reset(options={"reset_mask": last})
    after, _, terminated, _, infos = envs.step(np.zeros((count, 2)))
    expected, *_ = other.step(np.zeros((count, 2)))
    assert np.isfinite(after).all() and np.array_equal(after[:-1], expected[:-1])
    assert not terminated.any() and "error" not in infos and envs.steps[-1] == (0 if mode == "NextStep" else 1)
    if mode == "NextStep":
        k1 = np.where(last, envs._instances.get("k1"), 0.0)
        assert np.array_equal(infos["_drawn"], last) and np.array_equal(infos["drawn"]["k1"], k1)


@pytest.mark.parametrize(
    ("behaviour", "slope", "message"),
    [
        (1, 1.0, "fmi2DoStep"),
        (8, 1.0, "ended by the FMU at t = 0.525 s"),
        (0, np.inf, "an observation is not a finite number"),
    ],
)
def test_termination_and_infinite_observations_end_the_episode(faulty_fmu, behaviour, slope, message) -> None:
    """The FMU allows only one instance per process, so `with` closes the environment before the next test."""
    task = Task(
        fmu=faulty_fmu,
        actions="slope",
        observations="y",
        reward=lambda before, action, after: after[:, 0],
        step=0.1,
        length=100,
        failed_reward=0.0,
        start={"behaviour": behaviour},
    )
    with Env(task) as env:
        for _ in range(2):
            env.reset()
            for k in range(5):
                observed, reward, *ended, info = env.step([1.0])
                assert observed == pytest.approx([reward]) == [4.1 + 0.1 * k] and ended == [False, False] and info == {}
            assert np.array_equal(env.step([slope])[0], observed)
        env.reset()
        for _ in range(5):
            env.step([1.0])
        *_, terminated, truncated, info = env.step([slope])
        assert terminated and not truncated and message in info["error"]


def test_inputs_from_actions(task) -> None:
    """Calculates inputs from a rate and the previous inputs. Also takes a step in which all instances fail."""
    by_rate = replace(
        task,
        actions={"rate": (-6.0, 6.0)},
        inputs=MOTORS,
        to_inputs=lambda action, motors: motors + STEP * action * [1, -1],
        observations=(*MOTORS, "roll"),
        start={"theta1": 0.1},
        terminated=lambda before, action, after: after[:, 0] > 0.15,
    )
    envs = VectorEnv(by_rate, 2)
    assert np.array_equal(envs.reset()[0][:, :2], [[0.1, 0.0]] * 2)
    for _ in range(3):
        observed, _, terminated, *_ = envs.step([[5.0], [10.0]])
    assert np.allclose(observed[:, :2], [[0.13, -0.03], [0.16, -0.06]], atol=1e-15)
    assert terminated.tolist() == [False, True]
    observed, _, terminated, *_ = envs.step([[np.nan], [0.0]])
    assert terminated.tolist() == [True, False] and np.allclose(observed[:, 0], [0.13, 0.1])
    envs.step([[np.nan], [np.nan]])
    envs.step([[0.0], [0.0]])
    broken = VectorEnv(replace(by_rate, to_inputs=lambda action, motors: action), 2)
    broken.reset()
    with pytest.raises(ValueError, match=r"to_inputs must return \(2, 2\), it returned \(2, 1\)"):
        broken.step([[0.0], [0.0]])


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"actions": {"pitch": (-1, 1)}}, "pitch is not an input, its causality is output"),
        ({"actions": "theta9"}, "theta9"),
        ({"observations": ("yaw",)}, "yaw"),
        ({"observations": ()}, "observations: name at least one"),
        ({"actions": {"theta1": (1, -1)}}, "theta1 needs"),
        ({"length": 0}, "length must be an integer of at least 1"),
        ({"failed_reward": np.nan}, "failed_reward must be a finite number"),
        ({"step": 0.0}, "step above 0"),
        ({"inputs": MOTORS}, "inputs and to_inputs, or neither"),
        ({"start": {"k9": 1.0}}, "k9"),
        ({"privileged": ("yaw",)}, "yaw"),
        ({"noise": {"theta3": 1.0}}, "noise: theta3 is not among pitch, roll, tau1"),
        ({"noise": {"roll": -1.0}}, "noise: roll needs a finite number of at least 0, not -1"),
        ({"delays": {"goal": 1}}, "delays: goal is not among pitch, roll, tau1, theta1, theta2"),
        ({"delays": {"roll": 1.5}}, "delays: roll needs an integer of at least 0, not 1.5"),
        ({"goals": {"roll": (0.0, 1.0)}}, "goals: roll is an observation; choose another name"),
        ({"drawn": {"k1": (2.0, 1.0)}}, "drawn: k1 needs .low, high., low not above high, or a function, not"),
        ({"drawn": {"k1": 100.0}}, "drawn: k1 needs .low, high., .* not 100"),
        ({"start": {"k1": 100.0}, "drawn": {"k1": (100.0, 120.0)}}, "drawn: k1 also has a value in start"),
        ({"length": 2.5}, "length must be an integer of at least 1"),
        ({"length": True}, "length must be an integer of at least 1"),
        ({"step": "0.1"}, "step: '0.1' is not a number"),
        ({"failed_reward": "-1"}, "failed_reward: '-1' is not a number"),
        ({"actions": {"theta1": ("-1", "1")}}, "actions: theta1: the values are not numbers"),
        ({"actions": ("theta1", "theta1")}, "actions: theta1 is there twice"),
        ({"observations": ("roll", "pitch", "roll")}, "observations: roll is there twice"),
        ({"privileged": ("M", "M")}, "privileged: M is there twice"),
        ({"inputs": ("theta1", "theta1"), "to_inputs": np.add}, "inputs: theta1 is there twice"),
        ({"drawn": {"k1": ("100", "120")}}, "drawn: k1: the values are not numbers"),
        ({"goals": {"k1": (0.0, 1.0)}}, "goals: k1 is among drawn; choose another name"),
        ({"noise": {"roll": "1"}}, "noise: roll: '1' is not a number"),
        ({"delays": {"roll": True}}, "delays: roll needs an integer of at least 0, not True"),
        (
            {"observations": ("theta1", "roll"), "delays": {"theta1": 1}},
            "delays: theta1 is an observation and an action; choose another name for the action",
        ),
    ],
)
def test_invalid_tasks(task, changed, message) -> None:
    with pytest.raises(ValueError, match=message):
        VectorEnv(replace(task, **changed), 2)


def test_invalid_results_of_functions(task) -> None:
    for name in ("reward", "terminated"):
        envs = VectorEnv(replace(task, **{name: lambda before, action, after: after}), 2)
        with pytest.raises(gymnasium.error.ResetNeeded, match="reset comes before step"):
            envs.step(np.zeros((2, 2)))
        envs.reset()
        with pytest.raises(ValueError, match=rf"{name} must return \(2,\), it returned \(2, 3\)"):
            envs.step(np.zeros((2, 2)))
        with pytest.raises(ValueError, match=r"actions must be \(2, 2\), they are \(2,\)"):
            envs.step(np.zeros(2))
        with pytest.raises(ValueError, match="actions: the values are not numbers"):
            envs.step([["0", "1_0"], ["0", "0"]])
        with pytest.raises(ValueError, match=r"reset_mask must be \(2,\) of bool"):
            envs.reset(options={"reset_mask": [1, 0]})
        with pytest.raises(ValueError, match="options: 'reset_masks' is not known; there is 'reset_mask'"):
            envs.reset(options={"reset_masks": np.array([True, False])})
        envs.close()
        for call in (envs.reset, lambda envs=envs: envs.step(np.zeros((2, 2)))):
            with pytest.raises(gymnasium.error.ClosedEnvironmentError, match="the environment is closed"):
                call()
    with Env(task) as env, pytest.raises(ValueError, match="options: 'reset_mask' is not known; there are none"):
        env.reset(options={"reset_mask": np.array([True])})
    for name, values, message in [
        ("reward", np.array([0.0, np.nan]), "reward must return finite numbers, it returned nan in instance 1"),
        ("reward", np.array(["0", "1_0"]), "reward: the values are not numbers"),
        ("reward", np.array([0.0, 1j]), "reward: the values are not numbers"),
        ("terminated", np.array(["False", "False"]), "terminated must return Booleans, it returned <U5"),
        ("terminated", np.array([np.nan, 0.0]), "terminated must return Booleans, it returned float64"),
    ]:
        envs = VectorEnv(replace(task, **{name: lambda before, action, after, values=values: values}), 2)
        envs.reset()
        with pytest.raises(ValueError, match=message):
            envs.step(np.zeros((2, 2)))
    for value, message in [
        ("1", "goal: the values are not numbers"),
        (np.nan, "goal: its function must return a finite"),
    ]:
        with pytest.raises(ValueError, match=message):
            VectorEnv(replace(task, goals={"goal": lambda rng, value=value: value}), 2).reset()
    for count in (1, 2):
        drawn = iter(np.linspace(100, -1, count + 1)[1:])
        envs = VectorEnv(replace(task, drawn={"k1": lambda rng, drawn=drawn: next(drawn)}), count)
        with pytest.raises(fmu_run.FmuError, match=rf"instance {count - 1} cannot begin .* k1 = -1: .*k1"):
            envs.reset()


def test_the_task_of_the_example(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both motors follow the action, which is their rate, one step late; no episode costs more than a failure."""
    monkeypatch.chdir(ROOT)
    names = runpy.run_path(str(ROOT / "examples" / "task.py"))
    task = names["TASK"]
    envs = VectorEnv(task, 1024)
    observations, _ = envs.reset(seed=1)
    goals = observations[:, 4]
    assert (goals >= 0.2).all() and (goals <= 0.5).all()
    cost = np.zeros(1024)
    for step in range(1, task.length + 1):
        observations, rewards, _, truncated, _ = envs.step(np.ones((1024, 1)))
        if step == 1:
            assert np.allclose(rewards, -goals - 0.01), "the wrist must be at rest"
        cost += rewards
        assert truncated.all() == (step == task.length)
    assert np.allclose(observations[:, 0], names["RATE"] * names["STEP"] * (task.length - 2), rtol=1e-6)
    assert task.failed_reward < cost.min()
