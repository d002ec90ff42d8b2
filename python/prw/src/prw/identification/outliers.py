"""A robust fit, in which values far from the model count less.

The fit minimizes Huber's loss: the square of a residual up to LIMIT standard deviations, and beyond that a line. Because the fit compares
spectra, the loss does not fit into its residuals. Least squares have the same minimum as the loss if each residual beyond the limit is
replaced by the limit, so both are done in turns (Huber, Robust Statistics, 1981, Sec. 7.8, "modified residuals").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from prw.columns import si_unit
from prw.identification.experiment import Experiment, errors_of_steps
from prw.identification.fit import FOLLOWED, Solution, Task, fit
from prw.identification.model import Model
from prw.identification.path import quantum_of
from prw.motion import Array

#: Residual, in standard deviations, beyond which the loss is a line. Only one of 16 000 normally distributed values is beyond.
LIMIT = 4.0
#: Least standard deviation of a channel in steps of its encoder: a little more than of evenly distributed errors.
STEP = 0.4
#: Distance from the model, in limits, above which outliers are noted, because chance is no explanation.
NOTED = 1.5
#: Fits and limits alternate at most this number of times.
ROUNDS = 8
#: Standard deviation of a normal distribution in units of the median of its magnitude, which outliers hardly change.
DEVIATION = 1.4826


def fit_robustly(
    model: Model, experiments: Sequence[Experiment], task: Task, starts: int, seed: int
) -> tuple[list[Experiment], Solution]:
    """The fit with the robust loss: the experiments with limited values, and the solution. Other minima are sought in the last round."""
    found = list(experiments)
    solution = fit(model, found, task, 1)
    for _ in range(ROUNDS):
        found = [limited(e, modelled) for e, modelled in zip(experiments, solution.modelled)]
        before, solution = solution, fit(model, found, task, 1)
        if np.abs(solution.logarithms - before.logarithms).max() < FOLLOWED:
            break
    return found, fit(model, found, task, starts, seed) if starts > 1 else solution


def limited(experiment: Experiment, modelled: Array) -> Experiment:
    """The experiment with values that differ from the modelled ones (s, c) by at most the limit, and a note on each channel with outliers."""
    assert experiment.values is not None
    values, errors, notes = experiment.values.copy(), experiment.channel_errors.copy(), experiment.notes
    for i, name in enumerate(experiment.channels):
        column, residual = values[:, i].copy(), values[:, i] - modelled[:, i]
        residual -= np.nanmedian(residual)
        spread = DEVIATION * float(np.nanmedian(np.abs(residual)))
        # An encoder at rest has nearly the same error in all rows.
        reach = LIMIT * max(spread, STEP * quantum_of(column[np.abs(residual) <= LIMIT * spread]))
        far = np.abs(residual) > reach
        if not far.any():
            continue
        values[far, i] -= residual[far] - reach * np.sign(residual[far])
        # Outliers hide that a channel has the steps of an encoder.
        time = np.clip(experiment.time, experiment.sampled[0], experiment.sampled[-1])
        errors[:, :, i] = errors_of_steps(experiment.sampled, np.where(far, np.nan, column), time, experiment.bins)
        if (furthest := float(np.nanmax(np.abs(residual)))) > NOTED * reach:
            notes += (
                f"{far.sum()} values of {name} ({far.mean():.2%}) are more than {LIMIT:g} standard deviations from the model, at most "
                f"{furthest:.2g} {si_unit(name)}, and count less",
            )
    return replace(experiment, values=values, channel_errors=errors, notes=notes, limited=True)
