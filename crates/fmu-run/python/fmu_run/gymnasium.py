"""Gymnasium environments for any FMU: one instance (`Env`), or thousands in parallel (`VectorEnv`), both with the same `Task`::

    task = Task(fmu="model.fmu", actions={"u": (-1, 1)}, observations=("y",), step=0.01, length=500,
                reward=lambda before, action, after: -abs(after[:, 0]), failed_reward=-500.0)
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
from gymnasium.error import ResetNeeded
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

import fmu_run

__all__ = ["AutoresetMode", "Env", "Task", "VectorEnv"]

_Array = NDArray[np.float64]
_Bools = NDArray[np.bool_]
_Named = str | Sequence[str] | Mapping[str, tuple[float, float]]
_Info = dict[str, Any]


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
        Function (observation before, action, observation after) -> (n,).
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
        Start values that are drawn for each episode, by name: uniformly from (low, high), or by a function (generator, count) ->
        (count,).
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
    drawn: Mapping[str, tuple[float, float] | Callable[[np.random.Generator, int], ArrayLike]] = field(
        default_factory=dict
    )
    threads: int | None = 1


class VectorEnv(gymnasium.vector.VectorEnv[_Array, _Array, NDArray[Any]]):
    """Instances of one FMU or system that run episodes in parallel.

    If the FMU rejects a step of an instance, or if an observation is not finite, the episode of the instance terminates: the last
    observation is repeated, and `infos["error"]` contains the message (with SAME_STEP, `infos["final_info"]["error"]`). All other
    instances continue.

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
        if task.length < 1 or not task.step > 0:
            raise ValueError(f"length must be at least 1 and step above 0, they are {task.length} and {task.step}")
        if not np.isfinite(task.failed_reward):
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
            self._inputs, self._observed = tuple(task.inputs or actions), tuple(observations)
            for name in self._inputs:
                if name in fmu.variables and (found := fmu.variables[name].causality) != "input":
                    raise ValueError(f"{name} is not an input, its causality is {found}")
            self._instances = fmu.instances(num_envs, start=task.start, threads=task.threads)
            for names in (self._inputs, self._observed):
                self._instances.get(names)  # Raises for unknown names.
        except Exception:
            self.close()
            raise
        self.single_action_space, self.single_observation_space = _box(actions), _box(observations)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        #: (num_envs,): number of steps of each instance since its episode began.
        self.steps = np.zeros(num_envs, dtype=np.int64)
        self._drawn = {name: np.empty(num_envs) for name in task.drawn}
        self._over: _Bools = np.zeros(num_envs, dtype=bool)
        self._observation: _Array | None = None

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[_Array, _Info]:
        """Begin new episodes of all instances, or of those in `options["reset_mask"]`, (num_envs,) of bool. The first call always begins
        all.

        Returns
        -------
        (num_envs, observations), and an empty dict
        """
        super().reset(seed=seed)
        which = np.asarray((options or {}).get("reset_mask", np.ones(self.num_envs, dtype=bool)))
        if which.shape != (self.num_envs,) or which.dtype != bool:
            raise ValueError(f"reset_mask must be ({self.num_envs},) of bool, it is {which.shape} of {which.dtype}")
        if self._observation is None:
            which = np.ones(self.num_envs, dtype=bool)
            self._observation = np.empty((self.num_envs, len(self._observed)))
        self._begin(which, self._observation)
        return self._observation.copy(), {}

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
        before, renew = self._observation, self._over
        if before is None or (self._mode is AutoresetMode.DISABLED and renew.any()):
            which = "all" if before is None else f"episodes {np.flatnonzero(renew).tolist()} are over"
            raise ResetNeeded(f"reset comes before step: {which}")
        acting = np.asarray(actions, dtype=np.float64)
        if acting.shape != self.action_space.shape:
            raise ValueError(f"actions must be {self.action_space.shape}, they are {acting.shape}")
        after, errors = self._advance(acting, before)
        self.steps += 1
        rewards = self._judged("reward", self.task.reward(before, acting, after)).astype(np.float64)
        rewards[list(errors)] = self.task.failed_reward
        ends = self.task.terminated
        terminated = np.zeros(self.num_envs, dtype=bool)
        if ends is not None:
            terminated = self._judged("terminated", ends(before, acting, after)).astype(bool)
        terminated[list(errors)] = True
        truncated = self.steps >= self.task.length
        if self._mode is AutoresetMode.NEXT_STEP and renew.any():
            errors = {index: why for index, why in errors.items() if not renew[index]}
            rewards[renew], terminated[renew], truncated[renew] = 0.0, False, False
            self._begin(renew, after)
        infos: _Info = {}
        for index, why in errors.items():
            self._add_info(infos, {"error": why}, index)
        self._observation, self._over = after, terminated | truncated
        if self._mode is AutoresetMode.SAME_STEP and self._over.any():
            over, final = self._over.copy(), np.full(self.num_envs, None, dtype=object)
            for ended in np.flatnonzero(over):
                final[ended] = after[ended].copy()
            infos = {"final_obs": final, "_final_obs": over, "final_info": infos, "_final_info": over.copy()}
            self._begin(over, after)
        return after.copy(), rewards, terminated, truncated, infos

    def close_extras(self, **kwargs: Any) -> None:
        """Free the instances, and the FMU if it was opened here."""
        self.__dict__.pop("_instances", None)
        if self._own is not None:
            self._own.close()

    def _advance(self, actions: _Array, before: _Array) -> tuple[_Array, dict[int, str]]:
        """Perform a step. Return the observations after it, and the messages of instances whose step failed, by index."""
        after, values = np.full_like(before, np.nan), actions
        if self.task.to_inputs is not None:
            values = np.asarray(self.task.to_inputs(actions, self._instances.get(self._inputs)), dtype=np.float64)
            if values.shape != (wanted := (self.num_envs, len(self._inputs))):
                raise ValueError(f"to_inputs must return {wanted}, it returned {values.shape}")
        try:
            self._instances.advance(self._inputs, values, self.task.step, self._observed, out=after)
        except fmu_run.FmuError:  # All instances have failed.
            if not self._instances.errors:
                raise
        failed = ~np.isfinite(after).all(axis=1)
        if not failed.any():
            return after, {}
        after[failed], why = before[failed], self._instances.errors
        indices = np.flatnonzero(failed).tolist()
        return after, {index: why.get(index, "an observation is not a finite number") for index in indices}

    def _begin(self, which: _Bools, observation: _Array) -> None:
        """Begin new episodes of the selected instances, and write their first observations to `observation`."""
        for name, how in self.task.drawn.items():
            count = int(which.sum())
            self._drawn[name][which] = (
                how(self.np_random, count) if callable(how) else self.np_random.uniform(*how, count)
            )
        try:
            self._instances.reset(which, start=dict(self._drawn))
        except fmu_run.FmuError:
            if not self._instances.errors:
                raise
        for index, why in self._instances.errors.items():
            if which[index]:
                drawn = ", ".join(f"{name} = {values[index]:g}" for name, values in self._drawn.items())
                raise fmu_run.FmuError(f"instance {index} cannot begin an episode with {drawn or 'its start'}: {why}")
        observation[which] = self._instances.get(self._observed)[which]
        self.steps[which], self._over[which] = 0, False

    def _judged(self, name: str, values: ArrayLike) -> NDArray[Any]:
        judged = np.asarray(values)
        if judged.shape != (self.num_envs,):
            raise ValueError(f"{name} must return ({self.num_envs},), it returned {judged.shape}")
        return judged


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
        super().reset(seed=seed)
        self._one.np_random = self.np_random
        observation, _ = self._one.reset()
        return observation[0], {}

    def step(self, action: ArrayLike) -> tuple[_Array, SupportsFloat, bool, bool, _Info]:
        """Perform a step. If the FMU rejects it, or if an observation is not finite, `info["error"]` contains the message."""
        observation, reward, terminated, truncated, info = self._one.step(np.asarray(action)[None])
        details = {name: values[0] for name, values in info.items() if not name.startswith("_")}
        return observation[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), details

    def close(self) -> None:
        """Free the instance, and the FMU if it was opened here."""
        self._one.close()


def _opened(fmu: str | os.PathLike[str] | fmu_run.Fmu | fmu_run.System) -> fmu_run.Fmu | fmu_run.System:
    if isinstance(fmu, fmu_run.Fmu | fmu_run.System):
        return fmu
    return fmu_run.System(fmu) if os.fspath(fmu).endswith(".ssp") else fmu_run.Fmu(fmu)


def _bounds(what: str, named: _Named, variables: Mapping[str, fmu_run.Variable]) -> dict[str, tuple[float, float]]:
    if not isinstance(named, Mapping):
        found = {name: variables.get(name) for name in ([named] if isinstance(named, str) else named)}
        named = {
            name: (
                -np.inf if of is None or of.min is None else of.min,
                np.inf if of is None or of.max is None else of.max,
            )
            for name, of in found.items()
        }
    for name, bounds in named.items():
        if len(bounds) != 2 or not bounds[0] < bounds[1]:
            raise ValueError(f"{what}: {name} needs (low, high), low below high, not {bounds}")
    if not named:
        raise ValueError(f"{what}: name at least one variable")
    return dict(named)


def _box(bounds: Mapping[str, tuple[float, float]]) -> Box:
    low, high = np.array(list(bounds.values()), dtype=np.float64).T
    return Box(low, high, dtype=np.float64)
