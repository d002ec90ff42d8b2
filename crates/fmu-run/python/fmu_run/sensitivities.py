"""Derivatives of whole trajectories with respect to start values: `Sensitivities`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fmu_run.runs import Runs

_Array = NDArray[np.float64]
#: The largest step as a fraction of the value, the ratio of two successive steps, and the number of steps.
LARGEST, RATIO, STEPS = 1 / 8, 4.0, 6


class Sensitivities(Mapping[tuple[str, str], _Array]):
    """Derivatives of trajectories, by output and parameter: found["roll", "k1"] is (times,), in the unit of the output per unit of the
    parameter.

    Parameters
    ----------
    time
        (times,): times, s.
    at
        The values of the parameters at which the derivatives are, in the units of the FMU, by name.
    derivatives
        The derivatives, (times,) each, by output and parameter.
    errors
        Estimated largest error of each derivative, by output and parameter.
    steps
        The step of the parameter that was chosen for each derivative, by output and parameter.
    """

    def __init__(
        self,
        time: _Array,
        at: Mapping[str, float],
        derivatives: Mapping[tuple[str, str], _Array],
        errors: Mapping[tuple[str, str], float],
        steps: Mapping[tuple[str, str], float],
    ):
        self.time, self.at = time, dict(at)
        self._derivatives, self.errors, self.steps = dict(derivatives), dict(errors), dict(steps)

    def __getitem__(self, key: tuple[str, str]) -> _Array:
        return self._derivatives[key]

    def __iter__(self) -> Iterator[tuple[str, str]]:
        return iter(self._derivatives)

    def __len__(self) -> int:
        return len(self._derivatives)

    def __repr__(self) -> str:
        lines = [
            f"  {output} by {parameter}: up to {np.abs(found).max():.4g}, error up to {self.errors[output, parameter]:.1g}"
            for (output, parameter), found in self.items()
        ]
        return "\n".join([f"<Sensitivities at {len(self.time)} times", *lines]) + ">"


def differentiate(
    run: Callable[[Mapping[str, Any]], Runs],
    outputs: Sequence[str],
    values: Mapping[str, float],
    largest: Mapping[str, float],
) -> Sensitivities:
    """Central differences with several steps of each parameter, in one batch, extrapolated to fourth order from two successive steps.

    As the step decreases, the truncation error falls, but the noise of the FMU (rounding errors, or the tolerance of its solver) is divided
    by less. Both show in the change from one step to the next, so the step with the smallest change is chosen, for each output.

    run: performs runs with these start values. largest: the largest step by parameter.
    """
    each, names = 2 * STEPS, list(values)
    signed = np.concatenate([RATIO ** -np.arange(STEPS)] * 2) * np.repeat([1, -1], STEPS)
    start = {name: np.full(each * len(names), value) for name, value in values.items()}
    for k, name in enumerate(names):
        start[name][k * each : (k + 1) * each] += largest[name] * signed
    runs = run(start)
    derivatives, errors, steps = {}, {}, {}
    for k, name in enumerate(names):
        # The steps as they were rounded, and whether the FMU has accepted them in both directions.
        up, down = np.arange(k * each, (k + 1) * each).reshape(2, STEPS)
        step, ran = start[name][up] - start[name][down], runs.ok[up] & runs.ok[down]
        if ran.sum() < 3:
            raise ValueError(
                f"{name} cannot be varied about {values[name]:g}: {next(iter(runs.errors.values()))}; give a smaller step"
            )
        for output in outputs:
            trajectories = runs[output]
            shape = (-1, *[1] * (trajectories.ndim - 1))
            central = ((trajectories[up] - trajectories[down]) / step.reshape(shape))[ran]
            better = central[1:] + (central[1:] - central[:-1]) / (RATIO**2 - 1)
            change = np.abs(np.diff(better, axis=0)).reshape(len(better) - 1, -1).max(axis=1)
            best = int(np.nanargmin(change)) if np.isfinite(change).any() else 0
            derivatives[output, name], errors[output, name] = better[best], float(change[best])
            steps[output, name] = float(step[ran][best + 1] / 2)
    return Sensitivities(runs.time, values, derivatives, errors, steps)
