"""Motor motions for identification, and the information about the parameters that each of them gives.

The information is calculated as in the fit (see `statistics`), with unknown offsets and initial state, for a planned
experiment. Multisines have harmonics of 1/duration with Schroeder's phases (IEEE Trans. Inf. Theory 16 (1970) 85), which
keep their peaks low. All motions start and end at rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from prw.columns import CHANNELS, MEASURED
from prw.identification.experiment import Experiment, planned
from prw.identification.fit import Fitter, Solution, Task
from prw.identification.model import Model
from prw.identification.statistics import UNDETERMINED, condition, covariance_of, information_of, noise_corrected
from prw.motion import Array, Motion
from prw.testbed import ANGLE_OF

#: Seconds in which a motion fades in and out.
FADE = 0.5
#: A multisine with more harmonics than this is thinned out to at most twice this number.
MAX_LINES = 60
#: Highest frequency in Hz of the slow multisine, and of all motions.
SLOW, WIDEST = 4.0, 40.0
#: Condition number of an information matrix above which its least eigenvalue is a rounding error.
SINGULAR = 1e12
#: The default noise by channel, in SI.
DEFAULT_NOISE = {name: channel.noise for name, channel in MEASURED.items()}
#: Rounds of the multiplicative algorithm for the D-optimal spectrum.
ROUNDS = 300


class Limits(NamedTuple):
    """Limits of the motors: angle from the middle in rad, rate in rad/s, acceleration in rad/s2."""

    angle: float
    rate: float
    acceleration: float


def motions(
    model: Model, task: Task, limits: Limits, duration: float, rate: float, noise: Mapping[str, float]
) -> list[Motion]:
    """All candidates within `limits`: each kind with equal, opposite, single and independent motors, and an optimal multisine.

    duration: s. rate: samples per second. noise: standard deviations by channel, SI; the optimal multisine is made for
    these channels.
    """
    time = np.arange(int(round(duration * rate)) + 1) / rate
    top = min(WIDEST, rate / 5)
    spans = {"multisine_slow": _lines(duration, min(SLOW, top)), "multisine_wide": _lines(duration, top)}
    found = []
    for kind, frequency in spans.items():
        size = _natural(frequency, limits)
        waves = [_multisine(time, frequency, size, k) for k in (0, 1)]
        found += [_assemble(f"{kind}_{pattern}", time, waves, pattern, limits) for pattern in PATTERNS]
    sweeps = [_chirp(time, f, limits) for f in ((0.2, top), (top, 0.2))]
    found += [_assemble(f"chirp_{pattern}", time, sweeps, pattern, limits) for pattern in PATTERNS]
    found.append(_optimal(model, task, time, _lines(duration, top), limits, noise))
    return found


#: For each pattern, the factors of two waves in the motion of motor 1, and the factors in the motion of motor 2.
PATTERNS = {
    "equal": ((1, 0), (1, 0)),
    "opposite": ((1, 0), (-1, 0)),
    "single": ((1, 0), (0, 0)),
    "independent": ((1, 0), (0, 1)),
}


def information(
    model: Model, experiments: Sequence[Experiment], task: Task, logarithms: Array, noise: Mapping[str, float]
) -> Array:
    """Information of measured or planned experiments about the logarithms of task.names: (p, p), without priors."""
    unmeasured = [replace(experiment, values=None) for experiment in experiments]
    channels = {name for experiment in experiments for name in experiment.channels}
    fitter = Fitter(model, unmeasured, task, {name: noise[name] for name in channels})
    jacobians, of_noise = fitter.jacobians(np.asarray(logarithms, dtype=float))
    return noise_corrected(information_of(jacobians), of_noise)


def _lines(duration: float, top: float) -> Array:
    """Harmonics of 1/duration up to `top` Hz, thinned out evenly in the logarithm."""
    harmonics = np.arange(1, int(top * duration) + 1)
    if len(harmonics) > MAX_LINES:
        harmonics = np.unique(np.rint(np.geomspace(1, harmonics[-1], 2 * MAX_LINES)).astype(int))[-MAX_LINES * 2 :]
    return harmonics / duration


def _natural(frequency: Array, limits: Limits) -> Array:
    """The largest amplitudes within the limits. The angle limits them at low frequencies, the rate at middle frequencies, and
    the acceleration at high frequencies."""
    w = 2 * np.pi * frequency
    return np.minimum(np.minimum(limits.angle, limits.rate / w), limits.acceleration / w**2)


def _multisine(time: Array, frequency: Array, size: Array, shift: int) -> Array:
    """Angle, rate and acceleration, (3, n), of a sum of sines. shift: selects the phases."""
    k = np.arange(len(frequency))
    power = size**2 / max(np.sum(size**2), np.finfo(float).tiny)
    phase = -2 * np.pi * np.concatenate([[0], np.cumsum(np.cumsum(power))[:-1]]) + 2.4 * shift * (k**2 + 1)
    w = 2 * np.pi * frequency
    total = np.zeros((3, len(time)))
    for wk, ak, pk in zip(w, size, phase):
        sine, cosine = ak * np.sin(wk * time + pk), ak * np.cos(wk * time + pk)
        total += np.stack([sine, wk * cosine, -(wk**2) * sine])
    return total


def _chirp(time: Array, span: tuple[float, float], limits: Limits) -> Array:
    """Angle, rate and acceleration, (3, n), of a sine whose frequency goes from one end of the span to the other
    exponentially, with the amplitude that the limits allow."""
    duration = time[-1] - time[0]
    growth = np.log(span[1] / span[0]) / duration
    frequency = span[0] * np.exp(growth * (time - time[0]))
    phase = 2 * np.pi * (frequency - span[0]) / growth
    size = _natural(frequency, limits)
    angle = size * np.sin(phase)
    rate = np.gradient(angle, time, edge_order=2)
    return np.stack([angle, rate, np.gradient(rate, time, edge_order=2)])


def _faded(time: Array, wave: Array) -> Array:
    """The wave (3, n) between a fade-in and a fade-out, at rest at angle 0 before and after."""
    since, left = time - time[0], time[-1] - time
    x = np.clip(np.minimum(since, left) / FADE, 0, 1)
    sign = np.where(since < left, 1.0, -1.0)
    inside = (x > 0) & (x < 1)
    # smoothstep of fifth order: no jump of acceleration
    gain = x**3 * (10 - 15 * x + 6 * x**2)
    slope = np.where(inside, 30 * x**2 * (1 - x) ** 2 / FADE, 0.0) * sign
    bend = np.where(inside, 60 * x * (1 - x) * (1 - 2 * x) / FADE**2, 0.0)
    angle, rate, acceleration = wave
    return np.stack([gain * angle, gain * rate + slope * angle, gain * acceleration + 2 * slope * rate + bend * angle])


def _assemble(name: str, time: Array, waves: Sequence[Array], pattern: str, limits: Limits) -> Motion:
    """The waves (3, n) mixed for the two motors, faded, and scaled to the limits."""
    motors = [shares[0] * waves[0] + shares[1] * waves[1] for shares in PATTERNS[pattern]]
    return _within(name, time, motors, limits)


def _within(name: str, time: Array, motors: Sequence[Array], limits: Limits) -> Motion:
    """The motors' waves (3, n), faded and scaled to the limits."""
    motors = [_faded(time, wave) for wave in motors]
    peaks = np.max([np.abs(wave).max(axis=1) for wave in motors], axis=0)
    scale = min(limit / peak for limit, peak in zip(limits, peaks))
    theta, omega = (np.column_stack([scale * wave[i] for wave in motors]) for i in (0, 1))
    return Motion(time, theta, omega, name)


def _optimal(
    model: Model, task: Task, time: Array, frequency: Array, limits: Limits, noise: Mapping[str, float]
) -> Motion:
    """The multisine whose power is distributed over the frequencies, and over equal and opposite motor motion, so that
    the determinant of the information is largest within the limits (D-optimal; multiplicative algorithm, Silvey,
    Titterington and Torsney, Comm. Stat. A 7 (1978) 1379)."""
    share = 1e-4
    logarithms = task.first()
    steps = share * np.vstack([np.eye(len(logarithms)), -np.eye(len(logarithms))])
    response = np.array([model.at(task.values(logarithms + s)).response_at_hz(frequency, ANGLE_OF) for s in steps])
    slopes = (response[: len(logarithms)] - response[len(logarithms) :]) / (2 * share)
    rows = [CHANNELS.index(name) for name in noise]
    weighted = slopes[:, :, rows] / np.array(list(noise.values()))[:, None]
    directions = np.array([[1.0, 1.0], [1.0, -1.0]])
    visible = np.einsum("pfcm,dm->dfcp", weighted, directions).reshape(2 * len(frequency), len(rows), -1)
    each = np.einsum("kcp,kcq->kpq", visible.conj(), visible).real
    w = 2 * np.pi * frequency
    cost = 1 / limits.angle**2 + (w / limits.rate) ** 2 + (w**2 / limits.acceleration) ** 2
    each /= np.tile(cost, 2)[:, None, None]
    # Without this floor, an undetermined direction would make the matrix singular.
    floor = 1e-9 * np.trace(each.sum(axis=0)) * np.eye(len(logarithms))
    power = np.full(len(each), 1 / len(each))
    for _ in range(ROUNDS):
        inverse = np.linalg.inv(np.einsum("k,kpq->pq", power, each) + floor)
        power *= np.einsum("kpq,qp->k", each, inverse) / len(logarithms)
        power /= power.sum()
    size = np.sqrt(power.reshape(2, -1) / cost)
    # The mean of the motors and half their difference have different phases.
    mean, half = (_multisine(time, frequency, s, k) for k, s in enumerate(size))
    return _within("multisine_optimal", time, [mean + half, mean - half], limits)


def typical_error(information: Array) -> float:
    """Root mean square of the parameters' standard errors, as fractions; infinite if a combination is undetermined."""
    if condition(information) > SINGULAR:
        return np.inf
    return float(np.sqrt(np.mean(np.diag(covariance_of(information)))))


#: Sensors that come in pairs.
SENSORS = (("tau1", "tau2"), ("theta3", "theta4"), ("pitch", "roll"))
#: For advice, estimates are limited to the start values divided and multiplied by this factor.
REACH = 10.0
#: Duration in s, and samples per second, of a proposed experiment.
DURATION, RATE = 10.0, 1000.0
#: Descriptions of the patterns in messages.
DESCRIBED = {
    "equal": "equal motor rates",
    "opposite": "opposite motor rates",
    "single": "only one motor",
    "independent": "motors that move independently",
}


def advice(model: Model, experiments: Sequence[Experiment], solution: Solution) -> list[str]:
    """Experiments that would determine all parameters, each with the largest expected standard error: the best motion with
    the same sensors, and the best pair of sensors with the same motions. Experiments that do not help are not named;
    if none helps, the advice is to fix a parameter or to give it a prior."""
    task = replace(solution.task, distortions=())
    first = np.log([task.start[name] for name in task.names])
    point = np.clip(solution.logarithms[: len(first)], first - np.log(REACH), first + np.log(REACH))
    task = replace(task, start=task.values(point))
    noise = {**DEFAULT_NOISE, **solution.noise}
    prior = task.prior_information()
    have = prior + information(model, experiments, task, point, noise)
    channels = tuple(dict.fromkeys(name for experiment in experiments for name in experiment.channels))
    limits = _limits(experiments)
    trials = {}
    for motion in motions(model, task, limits, DURATION, RATE, {name: noise[name] for name in channels}):
        more = information(model, [planned(motion, channels)], task, point, noise)
        described = DESCRIBED.get(motion.name.rsplit("_", 1)[1], "a spectrum made for these parameters")
        reason = f"; `excite` proposes it for {','.join(channels)} as {motion.name}"
        trials[f"an experiment with {described}", reason] = _worst(have + more)
    sentences = _best(trials)
    trials = {}
    for pair in SENSORS:
        if not set(pair) <= set(channels):
            wider = [_measured_wholly(e, (*e.channels, *(c for c in pair if c not in e.channels))) for e in experiments]
            worst = _worst(prior + information(model, wider, task, point, noise))
            trials[f"measuring {' and '.join(pair)} as well in the same motion", ""] = worst
    return [*sentences, *_best(trials)] or [
        "fix a parameter or give it a prior; no single motion or pair of sensors is enough"
    ]


def _best(trials: Mapping[tuple[str, str], float]) -> list[str]:
    """A list with the description of the trial with the least error; empty if that error is too large. trials: errors
    by description."""
    (begin, end), error = min(trials.items(), key=lambda trial: trial[1], default=(("", ""), np.inf))
    return [f"{begin} (worst standard error then {error:.1%}{end})"] if error < UNDETERMINED else []


def _measured_wholly(experiment: Experiment, channels: tuple[str, ...]) -> Experiment:
    """The experiment with these channels, each sampled at all times and without encoder steps."""
    exact = np.zeros((1, experiment.bins, len(channels)), dtype=np.complex128)
    return replace(experiment, channels=channels, values=None, samplers=None, channel_errors=exact)


def _worst(information: Array) -> float:
    return float(np.sqrt(np.diag(covariance_of(information)).max()))


def _limits(experiments: Sequence[Experiment]) -> Limits:
    """Limits of the motors: the largest angle and rate in the experiments, and an acceleration of 40/s times that rate, but not
    less than small defaults."""
    angle = max(np.abs(e.theta - e.theta.mean(axis=0)).max() for e in experiments)
    rate = max(np.abs(e.omega).max() for e in experiments)
    return Limits(max(angle, 0.1), max(rate, 1.0), max(40 * rate, 50.0))
