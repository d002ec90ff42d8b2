"""Advice on undetermined combinations of parameters: another motion or another sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from prw.identification import design
from prw.identification.experiment import Experiment, planned
from prw.identification.fit import Solution
from prw.identification.model import Model
from prw.identification.statistics import UNDETERMINED, covariance_of
from prw.motion import Array

#: Sensors that come in pairs.
SENSORS = {
    "tau1 and tau2": ("tau1", "tau2"),
    "theta3 and theta4": ("theta3", "theta4"),
    "pitch and roll": ("pitch", "roll"),
}
#: Estimates are limited to this factor about their start values.
REACH = 10.0
DURATION, RATE = 10.0, 1000.0
#: The patterns of a motion in messages.
SAID = {
    "equal": "equal motors",
    "opposite": "opposite motors",
    "single": "one motor alone",
    "independent": "motors that move independently",
}


def advice(model: Model, experiments: Sequence[Experiment], solution: Solution) -> list[str]:
    """Experiments that would determine all parameters, each with the largest expected standard error: the best motion with
    the same sensors, and the best pair of sensors with the same motions. Experiments that do not help are not named."""
    task = replace(solution.task, distortions=())
    first = np.log([task.start[name] for name in task.names])
    point = np.clip(solution.logarithms[: len(first)], first - np.log(REACH), first + np.log(REACH))
    task = replace(task, start=task.values(point))
    noise = {**design.default_noise(), **solution.noise}
    have = design.with_priors(design.information(model, experiments, task, point, noise), task)
    channels = tuple(dict.fromkeys(name for experiment in experiments for name in experiment.channels))
    limits = _limits(experiments)
    trials = []
    candidates = design.motions(model, task, limits, DURATION, RATE, {name: noise[name] for name in channels})
    for motion in candidates:
        more = design.information(model, [planned(motion, channels)], task, point, noise)
        trials.append((_worst(have + more), motion.name))
    sentences: list[str] = []
    for error, name in sorted(trials)[:1]:
        if error < UNDETERMINED:
            pattern = name.rsplit("_", 1)[1]
            said = SAID.get(pattern, "a spectrum made for it")
            sentences.append(
                f"an experiment with {said} (worst standard error then {error:.1%}; "
                f"`excite` proposes it for {','.join(channels)} as {name})"
            )
    trials = []
    for name, pair in SENSORS.items():
        if set(pair) <= set(channels):
            continue
        wider = [_measured_wholly(e, (*e.channels, *(c for c in pair if c not in e.channels))) for e in experiments]
        found = design.with_priors(design.information(model, wider, task, point, noise), task)
        trials.append((_worst(found), name))
    for error, name in sorted(trials)[:1]:
        if error < UNDETERMINED:
            sentences.append(f"measuring {name} as well in the same motion (worst standard error then {error:.1%})")
    if not sentences:
        sentences.append("no single motion or pair of sensors; fix one of them or give it a prior")
    return sentences


def _measured_wholly(experiment: Experiment, channels: tuple[str, ...]) -> Experiment:
    """The experiment with these channels, each sampled at all times and without encoder steps."""
    exact = np.zeros((1, experiment.bins, len(channels)), dtype=np.complex128)
    return replace(experiment, channels=channels, values=None, samplers=None, channel_errors=exact)


def _worst(information: Array) -> float:
    return float(np.sqrt(np.diag(covariance_of(information)).max()))


def _limits(experiments: Sequence[Experiment]) -> design.Limits:
    """Limits of the motors: the largest values in the experiments, and at least small ones."""
    angle = max(np.abs(e.theta - e.theta.mean(axis=0)).max() for e in experiments)
    rate = max(np.abs(e.omega).max() for e in experiments)
    least = design.Limits(0.1, 1.0, 50.0)
    return design.Limits(max(angle, least.angle), max(rate, least.rate), max(40 * rate, least.acceleration))
