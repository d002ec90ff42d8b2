"""Possible causes if the model does not explain the data: faults with a known signature, and fits in which channels have
a delay, a lag or another gain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from prw.columns import QUANTITIES
from prw.identification.experiment import Experiment
from prw.identification.fit import Fitter, Solution, refitted
from prw.identification.response import DISTORTIONS, Distortion
from prw.identification.statistics import covariance_of, information_of
from prw.identification.verdict import CLEAR, PAIRS, Verdict, groups, judge, named, single_faults
from prw.motion import Array
from prw.progress import Progress

#: Gains that a wrong unit causes, within the factor TOLERANCE, each with the description of the fault.
SLIPS = {57.3: "in degrees, not radians", 1 / 57.3: "in radians, not degrees", 1000.0: "in thousandths of its unit"}
TOLERANCE = 1.7
#: Correlation above which two signals are alike, and below which they are unlike.
ALIKE, UNLIKE = 0.9, 0.7
#: A channel saturates if at least FLATS sequences of FLAT equal values are at an end of its range. A channel that is constant
#: for longer than STUCK, s, mostly while the motors move, is stuck.
FLAT, FLATS, STUCK = 4, 3, 0.25
#: The motors are at rest while the rate of the faster one is at most this share of its maximum.
AT_REST = 1e-3
#: Number of groups of channels that are fitted for each kind of distortion.
TRIED = 2
#: Another fault is named if its gain in likelihood exceeds this share of the best fault's: SHARE for an alternative to
#: the best fault, SECOND for a fault that remains after the best one is included.
SHARE, SECOND = 0.6, 0.05


def diagnose(solution: Solution, verdict: Verdict) -> list[str]:
    """Possible causes, a sentence each, the most likely first."""
    found = [cause for i, e in enumerate(solution.fitter.experiments) for cause in _obvious_causes(solution, i, e)]
    if found:
        return list(dict.fromkeys(found))
    causes = _causes(solution, verdict)
    reported = [cause.message for cause in causes[:2] if cause.gain > SHARE * causes[0].gain]
    if causes and not causes[0].explains:
        # Causes that remain if the first one is included in the fit.
        after = causes[0].after()
        left = judge(after)
        others = [] if left.fits else _causes(after, left)
        others = [c for c in others if c.name != causes[0].name and c.gain > SECOND * causes[0].gain]
        reported = [causes[0].message, *(f"besides, {other.message}" for other in others[:1])] if others else reported
    return reported


class _Cause(NamedTuple):
    """A possible cause.

    Attributes
    ----------
    gain
        Rise of twice the log likelihood if the cause is included, less 12 for each distorted channel.
    name, message
        Name of the fault and its description.
    explains
        Whether the data fit if the cause is included; False if this was not tested.
    after
        Returns the fit that includes the cause.
    """

    gain: float
    name: str
    message: str
    explains: bool
    after: Callable[[], Solution]


def _causes(solution: Solution, verdict: Verdict) -> list[_Cause]:
    """Possible causes, in decreasing order of gain."""
    causes = list(_refits(solution, verdict))
    signs = [fault for fault in verdict.faults if fault.clear > CLEAR and fault.signs]
    for fault in sorted(signs, key=lambda fault: -fault.gain)[:1]:
        size = f"{fault.size:.2g} +- {fault.error:.1g} {fault.unit}"
        message = f"{fault.name} of {size} would explain at least a part of the misfit: the residual follows the sign of a rate"
        causes.append(_Cause(fault.gain, fault.name, message, False, partial(_with_fault, solution, fault.name)))
    return sorted(causes, key=lambda cause: -cause.gain)


def _with_fault(solution: Solution, name: str) -> Solution:
    """The fit with this fault, of unknown size, in all experiments. It is repeated once, because the effect of the
    fault depends on the rates that the fit finds."""
    found = solution
    for _ in range(2):
        pairs = zip(found.fitter.experiments, found.comparisons)
        faults = [[column for n, _, column in single_faults(found, *pair) if n == name] for pair in pairs]
        found = refitted(found, (), faults)
    return found


def _obvious_causes(solution: Solution, i: int, experiment: Experiment) -> Iterator[str]:
    """Causes that are found without another fit: wrong units and signs, exchanged, saturated and stuck channels."""
    assert experiment.values is not None
    before = Fitter(solution.fitter.model, [experiment], replace(solution.task, distortions=()), solution.noise)
    first = before.task.first()
    gains, likes = [], []
    for outputs in (before.compare(first)[0].response.outputs, solution.comparisons[i].response.outputs):
        y, m = experiment.observed(outputs)[2:], experiment.measured[2:]
        # The lower bound avoids a division by 0 for channels at rest; the square of a smaller number would be 0.
        size, measured = (np.maximum(np.linalg.norm(values, axis=0), 1e-150) for values in (y, m))
        product = (y.conj().T @ m).real
        gains.append(np.diag(product) / size**2)
        likes.append(product / np.outer(size, measured))
    angles = [j for j, name in enumerate(experiment.channels) if QUANTITIES[name] != "torque"]
    if len(angles) > 1 and all(_slip(gains[0][j]) == 1 / 57.3 and likes[0][j, j] > UNLIKE for j in angles):
        yield "theta1, theta2 look as if they were in degrees, not radians"
        return
    for j, name in enumerate(experiment.channels):
        column = experiment.values[:, j]
        pair = next((p for p in PAIRS if name in p and set(p) <= set(experiment.channels)), None)
        if pair and name == pair[0]:
            k = experiment.channels.index(pair[1])
            for like in likes:
                if min(like[j, k], like[k, j]) > ALIKE and max(like[j, j], like[k, k]) < UNLIKE:
                    yield f"{name} and {pair[1]} are swapped: each follows the FMU's value of the other"
                    return
        for gain, like in zip(gains, likes):
            if like[j, j] < -ALIKE or (like[j, j] < -UNLIKE and abs(np.log(-gain[j])) < np.log(TOLERANCE)):
                yield f"{name} has the wrong sign: it is {gain[j]:.2g} times the FMU's value"
                break
            slip = _slip(gain[j])
            if slip and like[j, j] > UNLIKE:
                yield f"{name} looks as if it were {SLIPS[slip]}: it is {gain[j]:.3g} times the FMU's value"
                break
        speed = np.interp(experiment.sampled, experiment.time, np.abs(experiment.omega).max(axis=1))
        yield from _flat(name, experiment.sampled, column, speed > AT_REST * speed.max())


def _slip(gain: float) -> float:
    return next((s for s in SLIPS if gain > 0 and abs(np.log(gain / s)) < np.log(TOLERANCE)), 0.0)


def _flat(name: str, time: Array, column: Array, moving: NDArray[np.bool_]) -> Iterator[str]:
    """Messages if a channel saturates, or is constant while the motors move. time, column, moving: (n,)."""
    there = np.isfinite(column)
    time, column, moving = time[there], column[there], moving[there]
    edges = np.flatnonzero(np.diff(column) != 0)
    first, last = np.concatenate([[0], edges + 1]), np.concatenate([edges, [len(column) - 1]])
    long = last - first + 1
    # Channels without noise are often constant, which is not a fault.
    usual = float(np.median(long))
    if usual > 2:
        return
    for level, side in ((column.max(), "above"), (column.min(), "below")):
        flats = (column[first] == level) & (long >= FLAT)
        if flats.sum() >= FLATS:
            yield f"{name} is cut off at {level:.4g} (SI), {flats.sum()} times: it saturates, and values {side} are lost"
            return
    longest = int(np.argmax(long))
    if moving[first[longest] : last[longest] + 1].mean() > 0.5 and time[last[longest]] - time[first[longest]] > STUCK:
        yield f"{name} is stuck from {time[first[longest]]:.4g} to {time[last[longest]]:.4g} s, at {column[first[longest]]:.4g} (SI)"


def _refits(solution: Solution, verdict: Verdict) -> Iterator[_Cause]:
    """Distortions of single channels, of pairs and of all channels, as possible causes."""
    clear = {fault.name: fault.gain for fault in verdict.faults}

    def expected_gain(kind: str, group: Sequence[str]) -> float:
        """The gain in likelihood expected of a group, less 10 for each channel. So a group ranks below a channel that explains
        as much alone."""
        like = "gain" if kind == "gain" else "delay"
        parts = sum(clear.get(named(like, (name,)), 0.0) for name in group)
        return max(parts, clear.get(named(like, group), 0.0)) - 10 * len(group)

    tried = []
    for kind in DISTORTIONS:
        trials = sorted(groups(solution, kind), key=lambda group: -expected_gain(kind, group))
        tried += [(kind, group) for group in trials[:TRIED]]
    # Only the best set of a kind is reported.
    best: dict[str, tuple[float, tuple[Distortion, ...], Solution]] = {}
    with Progress("looking for causes", len(tried)) as progress:
        for done, (kind, group) in enumerate(tried):
            progress(done)
            new = tuple(Distortion(kind, name) for name in group)
            found = refitted(solution, new)
            gain = solution.deviance - found.deviance - 12 * len(group)
            if kind not in best or gain > best[kind][0]:
                best[kind] = gain, new, found
    greatest = max((gain for gain, *_ in best.values()), default=0.0)
    for kind, (gain, new, found) in best.items():
        if gain >= max(SHARE * greatest, CLEAR**2):
            good = judge(found).fits
            then = "with that, the data fit" if good else "that explains a part of the misfit"
            channels = ",".join(distortion.channel for distortion in new)
            message = (
                f"{_sizes(found, new)}: {then} (`identify` estimates it, too, with the argument {kind}: {channels})"
            )
            yield _Cause(gain, kind, message, good, partial(refitted, solution, new))


def _sizes(found: Solution, new: tuple[Distortion, ...]) -> str:
    """The estimates of the distortions `new`, the last unknowns of a fit, as a string; channels with equal estimates are
    listed together."""
    errors = np.sqrt(np.diag(covariance_of(information_of(found.jacobians) + found.task.prior_information())))
    sizes: dict[str, list[str]] = {}
    for distortion, x, error in zip(new, found.logarithms[-len(new) :], errors[-len(new) :]):
        sizes.setdefault(_size(distortion, distortion.value(x), float(error)), []).append(distortion.channel)
    return "; ".join(f"{', '.join(names)} {size}" for size, names in sizes.items())


def _size(distortion: Distortion, value: float, error: float) -> str:
    if distortion.kind == "gain":
        return f"reads {value:.4g} +- {error * value:.1g} times the true value"
    late = "late" if value > 0 else "early"
    if distortion.kind == "lag":
        return f"lags with a time constant of {value * 1e3:.3g} +- {error:.1g} ms"
    return f"comes {abs(value) * 1e3:.3g} +- {error:.1g} ms {late}"
