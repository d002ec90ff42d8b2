"""Gymnasium environments for any FMU: one instance (`Env`), or thousands in parallel (`VectorEnv`), both with the same `Task`::

    task = Task(
        fmu="model.fmu", actions={"u": (-1, 1)}, observations=("y",), step=0.01, length=500,
        reward=lambda before, action, after: -abs(after[:, 0]), failed_reward=-500.0,
    )
    envs = VectorEnv(task, 1024)

Needs the package gymnasium: pip install gymnasium.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, SupportsFloat

import gymnasium
import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

import fmu_run
from fmu_run._native import numbers

__all__ = ["AutoresetMode", "Env", "Task", "VectorEnv"]

_Array = NDArray[np.float64]
_Bools = NDArray[np.bool_]
_Named = str | Sequence[str] | Mapping[str, tuple[float, float]]
_Info = dict[str, Any]
#: A value for each episode: uniform from (low, high), or by a function of the environment's random generator.
_Draw = tuple[float, float] | Callable[[np.random.Generator], float]
#: Number of steps for which an environment draws its noise at a time.
_BLOCK = 64


@dataclass(frozen=True, kw_only=True)
class Task:
    """A learning task for an FMU. Its functions take and return arrays that have a row for each of n instances.

    Parameters
    ----------
    fmu
        The path of an FMU or of an SSP with a system of FMUs, or an open `Fmu` or `System`. The task can be registered or passed to
        another process only if it has a path.
    actions
        Inputs by name with their bounds (low, high), or only names. In the latter case the bounds are `min` and `max` of the model
        description, or infinite if it has none.
    observations
        Numeric variables that are observed after each step, in one of the forms of `actions`.
    reward
        Function (values before, action, values after) -> (n,). The values are (n, columns): the observations without noise and delay, the
        goals, and the privileged variables.
    step
        The time between actions, s.
    length
        Number of steps after which an episode is truncated.
    terminated
        Function with the arguments of `reward` -> (n,) of bool: whether the episode terminates.
    inputs
        Names of the inputs that `to_inputs` calculates, if the actions are not inputs. Actions may then have any names.
    to_inputs
        Function that converts actions to inputs: (actions, previous inputs (n, inputs)) -> (n, inputs).
    start
        Start values for all episodes, by name: numbers or strings.
    drawn
        Start values that are drawn for each episode, by name: uniformly from (low, high), or by a function of a random generator that
        returns a number. Each environment has its own generator, so its draws do not depend on how many environments there are.
    goals
        Values that are drawn for each episode like `drawn`, by any names. The agent observes them after the observations.
    privileged
        Names of numeric variables that `reward` and `terminated` use, but that the agent does not observe.
    noise
        Standard deviations of the noise of observations, by name.
    delays
        Numbers of steps by which observations and actions are late, by name. In an episode, late actions are 0 until the first arrives.
    failed_reward
        The reward for a step that the FMU rejects, or after which an observation is not finite. Such a step also ends the episode. The
        reward should be worse than anything that the rest of the episode can cost; otherwise the agent learns to provoke failures.
    threads
        Number of threads, as in `Fmu.instances`.
    """

    fmu: str | os.PathLike[str] | fmu_run.Fmu | fmu_run.System
    actions: _Named
    observations: _Named
    reward: Callable[[_Array, _Array, _Array], ArrayLike]
    step: float
    length: int
    failed_reward: float
    terminated: Callable[[_Array, _Array, _Array], ArrayLike] | None = None
    inputs: Sequence[str] | None = None
    to_inputs: Callable[[_Array, _Array], ArrayLike] | None = None
    start: Mapping[str, float | str] = field(default_factory=dict)
    drawn: Mapping[str, _Draw] = field(default_factory=dict)
    goals: Mapping[str, _Draw] = field(default_factory=dict)
    privileged: Sequence[str] = ()
    noise: Mapping[str, float] = field(default_factory=dict)
    delays: Mapping[str, int] = field(default_factory=dict)
    threads: int | None = 1


class VectorEnv(gymnasium.vector.VectorEnv[_Array, _Array, NDArray[Any]]):
    """Instances of one FMU or system that run episodes in parallel.

    If the FMU rejects a step of an instance, or if an observation is not finite, the episode of the instance terminates: the last
    observation is repeated, and `infos["error"]` contains the message (with SAME_STEP, `infos["final_info"]["error"]`). All other
    instances continue.

    When episodes begin, `infos["drawn"]` contains the start values and goals that were drawn, (num_envs,) by name.

    Parameters
    ----------
    task
        The learning task.
    num_envs
        Number of instances.
    autoreset_mode
        When a new episode replaces a finished one. NEXT_STEP: in the next step, whose action is ignored and whose reward is 0.
        SAME_STEP: in the same step, which also returns `infos["final_obs"]` and `infos["final_info"]`. DISABLED: only when the caller
        calls `reset(options={"reset_mask": ...})`.

    Raises
    ------
    ValueError
        For invalid arguments.
    fmu_run.FmuError
        If the FMU cannot be loaded or rejects the start values. `reset` and `step` raise it if the FMU rejects drawn start values.
    """

    _own: fmu_run.Fmu | fmu_run.System | None = None

    def __init__(self, task: Task, num_envs: int = 1, *, autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP):
        if not _is_integer(task.length) or task.length < 1 or not numbers("step", task.step) > 0:
            raise ValueError(
                f"length must be an integer of at least 1 and step above 0, they are {task.length} and {task.step}"
            )
        if not np.isfinite(numbers("failed_reward", task.failed_reward)):
            raise ValueError(f"failed_reward must be a finite number, it is {task.failed_reward}")
        if (task.inputs is None) != (task.to_inputs is None):
            raise ValueError("give inputs and to_inputs, or neither")
        self.task, self.num_envs = task, num_envs
        self._mode = AutoresetMode(autoreset_mode)
        self.metadata = {"autoreset_mode": self._mode}
        fmu = _opened(task.fmu)
        self._own = None if fmu is task.fmu else fmu
        try:
            actions = _bounds("actions", task.actions, fmu.variables)
            observations = _bounds("observations", task.observations, fmu.variables)
            self._privileged = _named("privileged", task.privileged)
            self._inputs = tuple(actions) if task.inputs is None else _named("inputs", task.inputs)
            self._read = (*observations, *self._privileged)
            _check_sensors(task, actions, observations)
            for name in self._inputs:
                if name in fmu.variables and (found := fmu.variables[name].causality) != "input":
                    raise ValueError(f"{name} is not an input, its causality is {found}")
            self._instances = fmu.instances(num_envs, start=task.start, threads=task.threads)
            for name in (*self._inputs, *self._read):
                # Raises for unknown names.
                if self._instances.get((name,)).shape != (num_envs, 1):
                    raise ValueError(f"{name} is an array; name its elements, such as {name}[1]")
        except Exception:
            self.close()
            raise
        goals = {name: (-np.inf, np.inf) if callable(how) else how for name, how in task.goals.items()}
        seen = {**observations, **goals}
        self.single_action_space, self.single_observation_space = _box(actions), _box(seen)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        #: (num_envs,): number of steps of each instance since its episode began.
        self.steps = np.zeros(num_envs, dtype=np.int64)
        #: The random generator of each instance.
        self.generators = [np.random.default_rng() for _ in range(num_envs)]
        self._drawn = np.empty((num_envs, len(task.drawn) + len(task.goals)))
        self._noisy = np.array([list(seen).index(name) for name in task.noise], dtype=np.int64)
        self._noise = np.empty((num_envs, _BLOCK, len(task.noise)))
        self._late = _Late([task.delays.get(name, 0) for name in seen], num_envs)
        self._late_actions = _Late([task.delays.get(name, 0) for name in actions], num_envs)
        self._seen = np.empty((num_envs, len(seen)))
        self._over: _Bools = np.zeros(num_envs, dtype=bool)
        self._values: _Array | None = None

    @property
    def values(self) -> _Array:
        """(num_envs, columns): the values that `reward` gets, after the last step."""
        if self._values is None:
            raise ResetNeeded("reset comes before values")
        return self._values.copy()

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Array, _Info]:
        """Begin new episodes of all instances, or of those in `options["reset_mask"]`, (num_envs,) of bool. The first call always begins
        all. Instance k has the seed `seed` + k, as in Gymnasium's own vector environments, or seed[k].

        Returns
        -------
        (num_envs, observations), and an empty dict
        """
        self._check_open()
        if unknown := [name for name in options or {} if name != "reset_mask"]:
            raise ValueError(f"options: {unknown[0]!r} is not known; there is 'reset_mask'")
        seeds = (
            list(seed)
            if isinstance(seed, Sequence | np.ndarray)
            else [None if seed is None else seed + k for k in range(self.num_envs)]
        )
        if len(seeds) != self.num_envs:
            raise ValueError(f"seed must have one number for each of {self.num_envs} environments, it has {len(seeds)}")
        which = np.asarray((options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if which.shape != (self.num_envs,) or which.dtype != bool:
            raise ValueError(f"reset_mask must be ({self.num_envs},) of bool, it is {which.shape} of {which.dtype}")
        if self._values is None:
            which = np.ones(self.num_envs, dtype=bool)
            self._values = np.empty((self.num_envs, len(self._read) + len(self.task.goals)))
        for index, own in enumerate(seeds):
            if which[index] and own is not None:
                self.generators[index] = np.random.default_rng(own)
        self._begin(which, self._values)
        return self._seen.copy(), self._begun(which)

    def step(self, actions: ArrayLike) -> tuple[_Array, _Array, _Bools, _Bools, _Info]:
        """Perform a step of all instances.

        Parameters
        ----------
        actions
            (num_envs, actions): an action for each instance.

        Returns
        -------
        observations (num_envs, observations), rewards, terminated and truncated (num_envs,), and infos
        """
        self._check_open()
        before, renew = self._values, self._over.copy()
        if before is None or (self._mode is AutoresetMode.DISABLED and renew.any()):
            which = "all" if before is None else f"episodes {np.flatnonzero(renew).tolist()} are over"
            raise ResetNeeded(f"reset comes before step: {which}")
        acting = numbers("actions", actions)
        if acting.shape != self.action_space.shape:
            raise ValueError(f"actions must be {self.action_space.shape}, they are {acting.shape}")
        applied = acting
        if self.task.delays:
            self._late_actions.push(acting)
            applied = self._late_actions.read()
        after, errors = self._advance(applied, before)
        self.steps += 1
        rewards = self._judged("reward", numbers("reward", self.task.reward(before, acting, after)))
        rewards[list(errors)] = self.task.failed_reward
        if (unknown := np.flatnonzero(~np.isfinite(rewards) & ~renew)).size:
            raise ValueError(
                f"reward must return finite numbers, it returned {rewards[unknown[0]]} in instance {unknown[0]}"
            )
        ends = self.task.terminated
        terminated = np.zeros(self.num_envs, dtype=bool)
        if ends is not None:
            terminated = self._judged("terminated", np.array(ends(before, acting, after)))
            if terminated.dtype != bool:
                raise ValueError(f"terminated must return Booleans, it returned {terminated.dtype}")
        terminated[list(errors)] = True
        truncated = self.steps >= self.task.length
        if self.task.delays:
            self._late.push(after[:, : self._seen.shape[1]])
        self._see(~renew if self._mode is AutoresetMode.NEXT_STEP else np.ones(self.num_envs, dtype=bool), after)
        if self._mode is AutoresetMode.NEXT_STEP and renew.any():
            errors = {index: why for index, why in errors.items() if not renew[index]}
            rewards[renew], terminated[renew], truncated[renew] = 0.0, False, False
            self._begin(renew, after)
            infos = self._begun(renew)
        else:
            infos = {}
        for index, why in errors.items():
            self._add_info(infos, {"error": why}, index)
        self._values, self._over = after, terminated | truncated
        if self._mode is AutoresetMode.SAME_STEP and self._over.any():
            over, final = self._over.copy(), np.full(self.num_envs, None, dtype=object)
            for ended in np.flatnonzero(over):
                final[ended] = self._seen[ended].copy()
            infos = {"final_obs": final, "_final_obs": over, "final_info": infos, "_final_info": over.copy()}
            self._begin(over, after)
            infos |= self._begun(over)
        return self._seen.copy(), rewards, terminated, truncated, infos

    def close_extras(self, **kwargs: Any) -> None:
        """Free the instances, and the FMU if it was opened here."""
        self.__dict__.pop("_instances", None)
        if self._own is not None:
            self._own.close()

    def _advance(self, actions: _Array, before: _Array) -> tuple[_Array, dict[int, str]]:
        """Perform a step. Return the values after it, and the messages of instances whose step failed, by index."""
        read, values = np.full((self.num_envs, len(self._read)), np.nan), actions
        if self.task.to_inputs is not None:
            values = numbers("to_inputs", self.task.to_inputs(actions, self._instances.get(self._inputs)))
            if values.shape != (wanted := (self.num_envs, len(self._inputs))):
                raise ValueError(f"to_inputs must return {wanted}, it returned {values.shape}")
        try:
            self._instances.advance(self._inputs, values, self.task.step, self._read, out=read)
        except fmu_run.FmuError:  # All instances have failed.
            if not self._instances.errors:
                raise
        after, failed = self._with_goals(read), ~np.isfinite(read).all(axis=1)
        if not failed.any():
            return after, {}
        after[failed], why = before[failed], self._instances.errors
        indices = np.flatnonzero(failed).tolist()
        return after, {index: why.get(index, "an observation is not a finite number") for index in indices}

    def _begin(self, which: _Bools, values: _Array) -> None:
        """Begin new episodes of the selected instances, and write their first values to `values`."""
        which = which.copy()  # It may be `self._over`, which changes below.
        indices = np.flatnonzero(which)
        names = [*self.task.drawn, *self.task.goals]
        draws = [*self.task.drawn.values(), *self.task.goals.values()]
        ranges = np.flatnonzero([not callable(how) for how in draws])
        if len(ranges):
            low, high = np.array([draws[column] for column in ranges], dtype=np.float64).T
            shares = np.array([self.generators[index].random(len(ranges)) for index in indices])
            self._drawn[np.ix_(indices, ranges)] = low + (high - low) * shares.reshape(-1, len(ranges))
        for column, how in enumerate(draws):
            if callable(how):
                found = numbers(names[column], [how(self.generators[index]) for index in indices])
                if found.shape != indices.shape or not np.isfinite(found).all():
                    one = found[0] if found.shape != indices.shape else found[~np.isfinite(found)][0]
                    raise ValueError(f"{names[column]}: its function must return a finite number, it returned {one}")
                self._drawn[indices, column] = found
        start = {name: np.ascontiguousarray(self._drawn[:, column]) for column, name in enumerate(self.task.drawn)}
        try:
            self._instances.reset(which, start=start)
        except fmu_run.FmuError:
            if not self._instances.errors:
                raise
        for index, why in self._instances.errors.items():
            if which[index]:
                drawn = ", ".join(f"{name} = {column[index]:g}" for name, column in start.items())
                raise fmu_run.FmuError(f"instance {index} cannot begin an episode with {drawn or 'its start'}: {why}")
        values[which] = self._with_goals(self._instances.get(self._read))[which]
        self.steps[which], self._over[which] = 0, False
        self._late.begin(which, values[which, : self._seen.shape[1]])
        self._late_actions.begin(which, np.zeros(1))
        self._see(which, values)

    def _begun(self, which: _Bools) -> _Info:
        """The information about new episodes: the start values and goals that were drawn, by name."""
        names = [*self.task.drawn, *self.task.goals]
        if not names:
            return {}
        values = {name: np.where(which, column, 0.0) for name, column in zip(names, self._drawn.T)}
        return {"drawn": {**values, **{f"_{name}": which.copy() for name in names}}, "_drawn": which.copy()}

    def _with_goals(self, read: _Array) -> _Array:
        """Insert the goals between the observations and the privileged variables."""
        if not self.task.goals:
            return read
        count = len(self._read) - len(self._privileged)
        return np.hstack([read[:, :count], self._drawn[:, len(self.task.drawn) :], read[:, count:]])

    def _see(self, which: _Bools, values: _Array) -> None:
        """Update what the agents of the selected instances observe: late and with noise."""
        exact = values[:, : self._seen.shape[1]]
        if not (self.task.delays or self.task.noise):
            self._seen = exact
            return
        self._seen[which] = (self._late.read() if self.task.delays else exact)[which]
        if len(self._noisy):
            block, indices = self.steps % _BLOCK, np.flatnonzero(which)
            for index in indices[block[indices] == 0]:
                self._noise[index] = self.generators[index].standard_normal(self._noise.shape[1:])
            deviations = np.array(list(self.task.noise.values()))
            self._seen[np.ix_(indices, self._noisy)] += deviations * self._noise[indices, block[indices]]

    def _judged(self, name: str, values: NDArray[Any]) -> NDArray[Any]:
        if values.shape != (self.num_envs,):
            raise ValueError(f"{name} must return ({self.num_envs},), it returned {values.shape}")
        return values

    def _check_open(self) -> None:
        if self.closed:
            raise ClosedEnvironmentError("the environment is closed")


class _Late:
    """Values (num_envs, columns) of the last steps, from which each column is read with its delay."""

    def __init__(self, delays: Sequence[int], num_envs: int):
        self._delays, self._columns, self._now = np.array(delays), np.arange(len(delays)), 0
        self._ring = np.zeros((max(delays) + 1, num_envs, len(delays)))

    def begin(self, which: _Bools, values: _Array) -> None:
        """Replace all values of the selected instances, because their episodes begin."""
        self._ring[:, which] = values

    def push(self, values: _Array) -> None:
        """Add the values of a step."""
        self._now = (self._now + 1) % len(self._ring)
        self._ring[self._now] = values

    def read(self) -> _Array:
        """Return the late values."""
        late: _Array = np.ascontiguousarray(
            self._ring[(self._now - self._delays) % len(self._ring), :, self._columns].T
        )
        return late


class Env(gymnasium.Env[_Array, _Array]):
    """One instance of an FMU or system that runs episodes, like a `VectorEnv` with one instance.

    Parameters
    ----------
    task
        The learning task.
    """

    def __init__(self, task: Task):
        self._one = VectorEnv(task, autoreset_mode=AutoresetMode.DISABLED)
        self.action_space, self.observation_space = self._one.single_action_space, self._one.single_observation_space

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[_Array, _Info]:
        """Begin a new episode."""
        if options:
            raise ValueError(f"options: {next(iter(options))!r} is not known; there are none")
        super().reset(seed=seed)
        self._one.generators = [self.np_random]
        observation, info = self._one.reset()
        drawn = {name: values[0] for name, values in info.get("drawn", {}).items() if not name.startswith("_")}
        return observation[0], {"drawn": drawn} if drawn else {}

    def step(self, action: ArrayLike) -> tuple[_Array, SupportsFloat, bool, bool, _Info]:
        """Perform a step. If the FMU rejects it, or if an observation is not finite, `info["error"]` contains the message."""
        observation, reward, terminated, truncated, info = self._one.step(np.asanyarray(action)[None])
        details = {name: values[0] for name, values in info.items() if not name.startswith("_")}
        return observation[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), details

    def close(self) -> None:
        """Free the instance, and the FMU if it was opened here."""
        self._one.close()


def _opened(fmu: str | os.PathLike[str] | fmu_run.Fmu | fmu_run.System) -> fmu_run.Fmu | fmu_run.System:
    if isinstance(fmu, fmu_run.Fmu | fmu_run.System):
        return fmu
    return fmu_run.System(fmu) if os.fspath(fmu).endswith(".ssp") else fmu_run.Fmu(fmu)


def _check_sensors(task: Task, actions: Mapping[str, Any], observations: Mapping[str, Any]) -> None:
    """Raise ValueError for invalid goals, noise or delays."""
    for what, named, known in (
        ("noise", task.noise, observations),
        ("delays", task.delays, {**observations, **actions}),
    ):
        if unknown := [name for name in named if name not in known]:
            raise ValueError(f"{what}: {unknown[0]} is not among {', '.join(known)}")
    if both := [name for name in task.delays if name in observations and name in actions]:
        raise ValueError(
            f"delays: {both[0]} is an observation and an action; choose another name for the action, with inputs and to_inputs"
        )
    for name in task.goals:
        if name in observations or name in task.drawn:
            what = "an observation" if name in observations else "among drawn"
            raise ValueError(f"goals: {name} is {what}; choose another name")
    if twice := [name for name in task.drawn if name in task.start]:
        raise ValueError(f"drawn: {twice[0]} also has a value in start; give one of both")
    for what, draws in (("drawn", task.drawn), ("goals", task.goals)):
        for name, how in draws.items():
            pair = None if callable(how) else numbers(f"{what}: {name}", how)
            if pair is not None and not (pair.shape == (2,) and np.isfinite(pair).all() and pair[0] <= pair[1]):
                raise ValueError(f"{what}: {name} needs (low, high), low not above high, or a function, not {how}")
    for name, deviation in task.noise.items():
        found = numbers(f"noise: {name}", deviation)
        if found.ndim or not (np.isfinite(found) and found >= 0):
            raise ValueError(f"noise: {name} needs a finite number of at least 0, not {deviation}")
    for name, delay in task.delays.items():
        if not _is_integer(delay) or delay < 0:
            raise ValueError(f"delays: {name} needs an integer of at least 0, not {delay!r}")


def _is_integer(value: object) -> bool:
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def _named(what: str, given: str | Sequence[str]) -> tuple[str, ...]:
    """One name or several names as a tuple. Raises ValueError if one is there twice."""
    names = (given,) if isinstance(given, str) else tuple(given)
    if twice := [name for k, name in enumerate(names) if name in names[:k]]:
        raise ValueError(f"{what}: {twice[0]} is there twice")
    return names


def _bounds(what: str, named: _Named, variables: Mapping[str, fmu_run.Variable]) -> dict[str, tuple[float, float]]:
    if not isinstance(named, Mapping):
        found = {name: variables.get(name) for name in _named(what, named)}
        named = {
            name: (
                -np.inf if of is None or of.min is None else of.min,
                np.inf if of is None or of.max is None else of.max,
            )
            for name, of in found.items()
        }
    for name, bounds in named.items():
        pair = numbers(f"{what}: {name}", bounds)
        if pair.shape != (2,) or not pair[0] < pair[1]:
            raise ValueError(f"{what}: {name} needs (low, high), low below high, not {bounds}")
    if not named:
        raise ValueError(f"{what}: name at least one variable")
    return dict(named)


def _box(bounds: Mapping[str, tuple[float, float]]) -> Box:
    low, high = np.array(list(bounds.values()), dtype=np.float64).T
    return Box(low, high, dtype=np.float64)
