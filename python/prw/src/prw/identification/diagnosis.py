"""Possible causes if the model does not explain the data: faults with a known signature, and hypotheses with which the fit is
repeated. If properties of the rig explain the data, the fit that includes them is the result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from prw.arguments import spelled
from prw.columns import QUANTITIES
from prw.identification.experiment import Experiment, prepare
from prw.identification.fit import FINE, Fitter, Prior, Solution, Task, fit, refitted
from prw.identification.kinds import KINDS
from prw.identification.model import Model
from prw.identification.path import quantum_of, rough_noise
from prw.identification.response import Distortion
from prw.identification.rounding import rounded
from prw.identification.statistics import certainty, covariance_of, information_of
from prw.identification.verdict import CLEAR, PAIRS, Hypothesis, Verdict, hypotheses, judge
from prw.motion import Array, Motion
from prw.progress import Progress
from prw.recording import Recording

#: Gains that a wrong unit causes, within the factor TOLERANCE, each with the description of the fault.
SLIPS = {57.3: "in degrees, not radians", 1 / 57.3: "in radians, not degrees", 1000.0: "in thousandths of its unit"}
TOLERANCE = 1.7
#: Correlation above which two signals are alike, and below which they are unlike.
ALIKE, UNLIKE = 0.9, 0.7
#: A channel saturates if at least FLATS sequences of FLAT equal values are at an end of its range, beyond which the model goes. A channel that is constant
#: for longer than STUCK, s, mostly while the motors move, is stuck if the model moves it by more than HIDDEN steps of its encoder, and by
#: more than this multiple of its noise.
FLAT, FLATS, STUCK, HIDDEN = 4, 3, 0.25, 5.0
#: The motors are at rest while the rate of the faster one is at most this share of its maximum.
AT_REST = 1e-3
#: Number of hypotheses of each kind with which the fit is repeated.
TRIED = 2
#: A hypothesis is tried if its expected gain in likelihood exceeds this share of the largest expected gain.
WORTH_TRYING = 0.05
#: Gain in likelihood for each unknown below which a hypothesis counts as chance. A hypothesis that does not explain the data must gain more,
#: see `_search`. One that does needs no more, because a fault of more than CLEAR standard errors is a misfit: it must have a cause.
COST = 12.0
#: A fit with a hypothesis that does not explain the data is refined at most this number of times.
REFINED = 2
#: Hypotheses that explain the data with a gain in likelihood that differs by less than this are not distinguished.
ALIKE_GAIN = 25.0
#: Maximum number of hypotheses that are combined. A further one that does not explain the data must gain more than this share of the first
#: one's gain.
MOST, SECOND = 3, 0.01
#: The hypothesis that the inertias differ from the drawing, and their standard deviation in the fit that frees them.
INERTIAS, DRAWING = Hypothesis("inertias", ("J2", "J3", "H3")), 0.1
TORQUES = ("tau1", "tau2")
#: Numbers of parts in which a recording is fitted, each with the number of parts that must fit; and minimum number of rows of a part. A parameter changes if the difference exceeds
#: this number of standard errors.
PARTS, SHORTEST, CHANGED = ((2, 2), (4, 3)), 1000, 6.0


class Cause(NamedTuple):
    """A possible cause of a misfit.

    Attributes
    ----------
    text
        Description, with sizes.
    argument, value
        The argument of `identify` with which it is estimated, too; empty if there is none.
    hint
        What would distinguish it from other causes; empty if it is the only one.
    """

    text: str
    argument: str = ""
    value: Any = ()
    hint: str = ""

    def message(self, command: bool = False) -> str:
        """The description and the remedy in one sentence. command: whether the remedy is an option of the command, instead of a
        Python argument."""
        remedy = f" (to estimate it, add {spelled(self.argument, self.value, command)})" if self.argument else ""
        return f"{self.text}{remedy}{'; ' if self.hint else ''}{self.hint}"

    def applied(self, task: Task) -> Task:
        """The task in which it is estimated, too."""
        if self.argument == "priors":
            return task.including(priors={name: Prior(task.start[name], x) for name, x in self.value.items()})
        if self.argument == "drift":
            return task.including(drift=tuple(self.value))
        return task.including(tuple(Distortion(self.argument, place) for place in self.value))


class Explanation(NamedTuple):
    """The result of a search for causes.

    Attributes
    ----------
    solution, verdict
        The fit with the properties of the rig that were found, and its verdict. Without any, the fit and verdict before.
    causes
        Possible causes of the misfit, the most likely first; also those that are in `solution`.
    tried, left_out
        Names of the hypotheses with which the fit was repeated, and with which it was not.
    known
        Whether the causes explain the data.
    """

    solution: Solution
    verdict: Verdict
    causes: tuple[Cause, ...]
    tried: tuple[str, ...]
    known: bool = True
    left_out: tuple[str, ...] = ()

    @property
    def unclear(self) -> str:
        """Why the first cause cannot be followed without a decision of the user; empty if it can."""
        if not self.causes:
            return "no cause was found"
        if not self.causes[0].argument:
            return "the recording has to be corrected first"
        return next((f"several causes explain the data; {cause.hint}" for cause in self.causes if cause.hint), "")


class _Trial(NamedTuple):
    """A fit that includes one more hypothesis. gain: rise of twice the log likelihood, less COST for each unknown."""

    hypothesis: Hypothesis
    gain: float
    solution: Solution
    verdict: Verdict


class _Round(NamedTuple):
    """A cause that was found, with the fit that also includes those before it, and other causes that may be there in its place."""

    best: _Trial
    rivals: list[_Trial]


def explain(solution: Solution, verdict: Verdict) -> Explanation:
    """Search for causes of a misfit."""
    found = [cause for i, e in enumerate(solution.fitter.experiments) for cause in _obvious_causes(solution, i, e)]
    if found:
        return Explanation(solution, verdict, tuple(map(Cause, dict.fromkeys(found))), ())
    rounds, tried, left_out = _search(solution, verdict)
    known = bool(rounds) and rounds[-1].best.verdict.fits
    # If the first cause alone explains no channel, and all together do not explain the data, further ones would be guesses.
    if not known and rounds and len(rounds[0].best.verdict.misfits) >= len(verdict.misfits) > 1:
        rounds = rounds[:1]
    named = Explanation(solution, verdict, tuple(_described(rounds)), tried, known, left_out)
    assumed = [trial for best, rivals in rounds for trial in (best, *rivals)]
    if not known or not all(trial.hypothesis.belongs for trial in assumed):
        return named
    best, rivals = rounds[-1]
    exact = refitted(best.solution, tolerances=FINE)
    judged = judge(exact)
    if not judged.fits:
        return named
    # The intervals contain the estimates with every rival.
    count, widening = len(solution.task.names), judged.widening.copy()
    for rival in rivals:
        widening[:count] = np.hypot(
            widening[:count], (rival.solution.logarithms - exact.logarithms[: len(rival.solution.logarithms)])[:count]
        )
    return named._replace(solution=exact, verdict=judged._replace(widening=widening))


def _search(solution: Solution, verdict: Verdict) -> tuple[list[_Round], tuple[str, ...], tuple[str, ...]]:
    """Add one cause after the other until the data fit. Returns these causes, and the names of the hypotheses that were tried and of
    those that were not."""
    rounds: list[_Round] = []
    tried: dict[str, None] = {}
    others: dict[str, None] = {}
    last = _Trial(INERTIAS, 0.0, solution, verdict)
    while len(rounds) < MOST and not last.verdict.fits:
        trials, fitted, left_out = _trials(last.solution, last.verdict)
        tried.update(dict.fromkeys(map(str, fitted)))
        others.update(dict.fromkeys(map(str, left_out)))
        first = rounds[0].best.gain if rounds else 0.0
        likely = [t for t in trials if t.gain > (0 if t.verdict.fits else max(CLEAR**2, SECOND * first))]
        if not likely:
            break
        last = _refined(likely[0])
        rounds.append(_Round(last, _rivals(last, [t for t in trials if t is not likely[0]])))
    return rounds, tuple(tried), tuple(name for name in others if name not in tried)


def _refined(trial: _Trial) -> _Trial:
    """The trial with a more exact fit, unless it fits: far from the solution, the patterns of large effects need more rounds."""
    for _ in range(REFINED):
        if trial.verdict.fits:
            break
        before, refined = trial.solution.deviance, refitted(trial.solution, tolerances=FINE)
        trial = trial._replace(solution=refined, verdict=judge(refined))
        if before - refined.deviance < COST:
            break
    return trial


def _rivals(best: _Trial, rest: list[_Trial]) -> list[_Trial]:
    """The trials among `rest` that the data do not distinguish from the best one."""
    kind, places = best.hypothesis
    alike = [
        t
        for t in rest
        if t.verdict.fits
        and t.gain > best.gain - ALIKE_GAIN
        # The same delay of more or fewer channels is not another cause.
        and (t.hypothesis.kind != kind or not set(t.hypothesis.places) & set(places))
    ]
    # A gain of all torques and wrong inertias have nearly the same effect.
    scales = [t for t in rest if t.hypothesis == INERTIAS or _all_torques(t.hypothesis, t.solution)]
    if best.hypothesis == INERTIAS or _all_torques(best.hypothesis, best.solution):
        alike += scales
    return list({t.hypothesis: t for t in alike}.values())


class Part(NamedTuple):
    """A fit of a part of the recordings: from and to these fractions of each one's duration."""

    begin: float
    end: float
    solution: Solution
    errors: Array

    def value(self, name: str) -> tuple[float, float]:
        """The parameter's estimate and its standard error, SI."""
        value, i = self.solution.values[name], self.solution.task.names.index(name)
        return value, value * float(self.errors[i])


def over_time(model: Model, recordings: Sequence[Recording], task: Task, how: Sequence[Any]) -> list[Part]:
    """The fits of halves of the recordings, or else of quarters, if the parts fit and a parameter changes; else an empty list. A quarter
    in which a parameter jumps does not fit and is left out. how: the further arguments of `prepare` for each recording."""
    for count, least in PARTS:
        found = []
        for k in range(count):
            sections = [_section(each, k / count, (k + 1) / count) for each in recordings]
            if min(len(each.time) for each in sections) < SHORTEST:
                return []
            solution = fit(model, [prepare(each, *more) for each, more in zip(sections, how)], task, 1)
            verdict = judge(solution)
            if verdict.fits:
                found.append(Part(k / count, (k + 1) / count, solution, certainty(solution, verdict.widening).relative))
            elif k - len(found) >= count - least:
                break
        if len(found) >= least:
            return found if changes(found) else []
    return []


def changes(parts: Sequence[Part]) -> list[str]:
    """The parameters that differ significantly between parts, with their values in SI."""
    found = []
    for name in parts[0].solution.task.names if parts else ():
        values = [part.value(name) for part in parts]
        low, high = min(values), max(values)
        if high[0] - low[0] > CHANGED * np.hypot(low[1], high[1]):
            each = ", ".join(" +- ".join(rounded(*value)) for value in values)
            count = round(1 / (parts[0].end - parts[0].begin))
            which = f"{count} parts" if len(parts) == count else f"{len(parts)} of {count} parts"
            found.append(f"{name} changes over time ({each} in {which} of equal length)")
    return found


def _section(recording: Recording, begin: float, end: float) -> Recording:
    """The rows of a recording between two fractions of its length."""
    motion, rows = recording.motion, slice(int(begin * len(recording.time)), int(end * len(recording.time)))
    omega = None if motion.omega is None else motion.omega[rows]
    cut = Motion(motion.time[rows], motion.theta[rows], omega, motion.name, motion.notes)
    return replace(recording, motion=cut, measured={name: y[rows] for name, y in recording.measured.items()})


def _all_torques(hypothesis: Hypothesis, solution: Solution) -> bool:
    """Whether it is a gain of all torque channels that were measured."""
    return hypothesis.kind == "gain" and set(hypothesis.places) == set(TORQUES) & set(solution.fitter.channels)


def _trials(solution: Solution, verdict: Verdict) -> tuple[list[_Trial], list[Hypothesis], list[Hypothesis]]:
    """Fits with one more hypothesis, in decreasing order of gain, without impossible ones; all hypotheses that were tried; and those that
    were not, because less gain was expected of them."""
    clear: dict[Hypothesis, float] = {}
    for fault in verdict.faults:
        clear[fault.hypothesis] = max(fault.gain, clear.get(fault.hypothesis, 0.0))

    def expected_gain(hypothesis: Hypothesis) -> float:
        """The gain in likelihood expected of a hypothesis, less 10 for each place. So a group ranks below a channel that explains
        as much alone."""
        like = "delay" if hypothesis.kind == "lag" else hypothesis.kind
        parts = sum(clear.get(Hypothesis(like, (name,)), 0.0) for name in hypothesis.places)
        return max(parts, clear.get(Hypothesis(like, hypothesis.places), 0.0)) - 10 * len(hypothesis.places)

    ranked: list[tuple[float, Hypothesis]] = []
    left_out: list[Hypothesis] = []
    for kind in (*KINDS, "drift"):
        each = sorted(((expected_gain(h), h) for h in hypotheses(solution, kind)), key=lambda pair: -pair[0])
        ranked += each[:TRIED]
        left_out += [hypothesis for _, hypothesis in each[TRIED:]]
    least = max(CLEAR**2 / 2, WORTH_TRYING * max((gain for gain, _ in ranked), default=0.0))
    chosen = [hypothesis for gain, hypothesis in ranked if gain > least]
    left_out += [hypothesis for gain, hypothesis in ranked if gain <= least]
    measured = set(TORQUES) & set(solution.fitter.channels)
    if (
        measured
        and not set(INERTIAS.places) & set(solution.task.names)
        and set(INERTIAS.places) <= set(solution.task.start)
    ):
        chosen.append(INERTIAS)
    trials = []
    with Progress("looking for causes", len(chosen)) as progress:
        for done, hypothesis in enumerate(chosen):
            progress(done)
            found = _including(solution, hypothesis)
            unknowns = max(len(hypothesis.distortions), 3 if not hypothesis.distortions else 1)
            gain = solution.deviance - found.deviance - COST * unknowns
            if not hypothesis.positive or all(x > 0 for x in found.logarithms[-len(hypothesis.distortions) :]):
                trials.append(_Trial(hypothesis, gain, found, judge(found) if gain > 0 else verdict))
    return sorted(trials, key=lambda trial: -trial.gain), chosen, left_out


def _including(solution: Solution, hypothesis: Hypothesis) -> Solution:
    """The fit that includes a hypothesis."""
    if hypothesis == INERTIAS:
        start = solution.task.start
        return refitted(solution, priors={name: Prior(start[name], DRAWING) for name in hypothesis.places})
    if hypothesis.kind == "drift":
        return refitted(solution, drift=hypothesis.places)
    return refitted(solution, hypothesis.distortions)


def _described(rounds: list[_Round]) -> list[Cause]:
    """The causes in words, with their sizes in the fit with all of them, and rivals of the last one."""
    found: list[Cause] = []
    for best, _ in rounds:
        last = rounds[-1].best
        then = "with that, the data fit" if best is last and last.verdict.fits else "that explains a part of the misfit"
        found.append(_cause(best, last.solution, "besides, " if found else "", then))
    for rival in rounds[-1].rivals if rounds else ():
        kinds = {rounds[-1].best.hypothesis.kind, rival.hypothesis.kind}
        fits = "fits as well" if rival.verdict.fits else "explains a part"
        found.append(_cause(rival, rival.solution, "or ", fits)._replace(hint=_deciding(kinds)))
    return found


def _deciding(kinds: set[str]) -> str:
    """The recording or measurement that distinguishes two kinds of causes."""
    if "inertias" in kinds:
        return "no motion distinguishes these two; weigh the parts, or load the torque sensors with a known torque"
    if "crosstalk" in kinds:
        return "to decide, record a motion with one motor at rest"
    if kinds <= {"delay", "lag"}:
        return "to decide, record a motion with higher frequencies"
    if "drift" in kinds:
        return "to decide, record the same motion for twice as long"
    return (
        "to decide, record the same motion with half the amplitude, too, and identify both recordings together: only the true cause "
        "has the same size in both"
    )


def _cause(trial: _Trial, solution: Solution, begin: str, then: str) -> Cause:
    """The cause in words, with the sizes that a fit found."""
    kind, places = trial.hypothesis
    task = solution.task
    if trial.hypothesis == INERTIAS:
        sums = ", ".join(
            f"{each.name} {_percent(each.off, each.error)} {each.about}" for each in sums_of_inertias(solution)
        )
        errors = dict(zip(task.names, _errors(solution).tolist()))
        alone = ", ".join(f"{n} {_percent(solution.values[n] / task.start[n] - 1, errors[n])}" for n in places)
        sizes = f"{sums}; each alone is known less well: {alone}"
        value: Any = dict.fromkeys(places, DRAWING)
        return Cause(f"{begin}the inertias differ from the start values ({sizes}): {then}", "priors", value)
    if kind == "drift":
        spans = [
            np.ptp(c.drift[:, e.channels.index(p)])
            for e, c in zip(solution.fitter.experiments, solution.comparisons)
            for p in places
            if p in e.channels
        ]
        return Cause(f"{begin}{places[0]} drifts slowly, by {max(spans):.2g} in SI: {then}", kind, places)
    return Cause(f"{begin}{_sizes(solution, trial.hypothesis.distortions)}: {then}", kind, places)


class Sum(NamedTuple):
    """A sum of inertias, on which a motion depends.

    Attributes
    ----------
    name, about
        The sum in parameters' names, and the motion.
    off, error
        Relative difference from the start values, and its standard error.
    """

    name: str
    about: str
    off: float
    error: float


def sums_of_inertias(solution: Solution) -> list[Sum]:
    """The inertias that turn in pitch and in roll, see eq. (5): the motion of the wrist depends on these two sums of three inertias, so that
    they are known better than each inertia alone. solution: of a fit that estimates all three."""
    task, counts = solution.task, solution.fitter.model.known.counts
    share = counts["N"].start ** 2 / (2 * counts["M"].start ** 2)
    covariance = covariance_of(information_of(solution.jacobians) + task.prior_information())
    found = []
    for about, shares in (("in pitch", {"J2": 1.0, "H3": 0.5}), ("in roll", {"J2": 1.0, "J3": share})):
        indices = [task.names.index(name) for name in shares]
        parts = np.array([shares[name] * solution.values[name] for name in shares])
        start = sum(shares[name] * task.start[name] for name in shares)
        # Derivatives of the logarithm of the sum with respect to the logarithms of the inertias.
        slope = parts / parts.sum()
        error = float(np.sqrt(slope @ covariance[np.ix_(indices, indices)] @ slope))
        name = " + ".join(n if x == 1 else f"{x:.4g} {n}" for n, x in shares.items())
        found.append(Sum(name, about, float(parts.sum() / start - 1), error))
    return found


def _percent(off: float, error: float) -> str:
    """A relative difference with its standard error."""
    return f"{'+' if off > 0 else ''}{' +- '.join(rounded(100 * off, 100 * error))} %"


def _sizes(solution: Solution, distortions: tuple[Distortion, ...]) -> str:
    """The sizes of distortions of a fit; channels with equal sizes are listed together."""
    errors = _errors(solution)
    sizes: dict[str, list[str]] = {}
    for distortion in distortions:
        i = solution.task.unknowns.index(str(distortion))
        x = float(solution.logarithms[i])
        size, name = _size(distortion, distortion.value(x), float(errors[i]))
        sizes.setdefault(size, []).append(name)
    return "; ".join(f"{', '.join(names)} {size}" for size, names in sizes.items())


def _errors(solution: Solution) -> Array:
    """Standard errors (p,) of the unknowns."""
    known = information_of(solution.jacobians) + solution.task.prior_information()
    errors: Array = np.sqrt(np.diag(covariance_of(known)))
    return errors


def _size(distortion: Distortion, value: float, error: float) -> tuple[str, str]:
    """The size in words, and the name of the channel or the effect. error: of the unknown."""
    kind = KINDS[distortion.kind]
    if distortion.kind == "gain":
        return f"reads {value:.4g} +- {error * value:.1g} times the true value", distortion.channel
    sized = f"{abs(value) / kind.factor:.3g} +- {error * kind.scale / kind.factor:.1g}"
    if distortion.kind == "lag":
        return f"lags with a time constant of {'-' if value < 0 else ''}{sized} ms", distortion.channel
    if distortion.kind == "delay":
        return f"comes {sized} ms {'late' if value > 0 else 'early'}", distortion.channel
    name, size = kind.worded(str(distortion), value, error * kind.scale)
    return f"of {size}", name


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
    if turned := _turned(before, first, experiment, np.diag(likes[0])):
        yield turned
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
        known = column[np.isfinite(column)]
        hidden = HIDDEN * max(quantum_of(known), rough_noise(known))
        yield from _flat(
            name, experiment.sampled, column, speed > AT_REST * speed.max(), solution.modelled[i][:, j], hidden
        )


def _turned(fitter: Fitter, point: Array, experiment: Experiment, likes: Array) -> str:
    """A message if motors have the wrong sign, else an empty string: several channels then follow the FMU only if these motors turn the
    other way. likes: (c,), correlations of the channels with the FMU's values. point: the parameters."""
    unlike = likes < UNLIKE
    for signs, which in (((-1, 1), "theta1 has"), ((1, -1), "theta2 has"), ((-1, -1), "theta1 and theta2 have")):
        jumps = None if experiment.jumps is None else experiment.jumps * signs
        other = replace(experiment, theta=experiment.theta * signs, omega=experiment.omega * signs, jumps=jumps)
        outputs = Fitter(fitter.model, [other], fitter.task, fitter.noise).compare(point)[0].response.outputs
        y, m = experiment.observed(outputs)[2:], experiment.measured[2:]
        size = np.maximum(np.linalg.norm(y, axis=0) * np.linalg.norm(m, axis=0), 1e-150)
        if unlike.sum() > 1 and (np.sum(y.conj() * m, axis=0).real / size > ALIKE).all():
            return f"{which} the wrong sign: all channels follow the FMU if the sign is changed"
    return ""


def _slip(gain: float) -> float:
    return next((s for s in SLIPS if gain > 0 and abs(np.log(gain / s)) < np.log(TOLERANCE)), 0.0)


def _flat(
    name: str, time: Array, column: Array, moving: NDArray[np.bool_], modelled: Array, hidden: float
) -> Iterator[str]:
    """Messages if a channel saturates, or is constant while the motors move. time, column, moving, modelled: (n,). hidden: motion of the
    modelled channel that the measured one need not show, for example because the shaft of one motor rests while the other moves."""
    there = np.isfinite(column)
    time, column, moving, modelled = time[there], column[there], moving[there], modelled[there]
    edges = np.flatnonzero(np.diff(column) != 0)
    first, last = np.concatenate([[0], edges + 1]), np.concatenate([edges, [len(column) - 1]])
    long = last - first + 1
    # Channels without noise are often constant, which is not a fault.
    usual = float(np.median(long))
    if usual > 2:
        return
    saturated, step = False, quantum_of(column)
    for level, sign, side in ((column.max(), 1, "above"), (column.min(), -1, "below")):
        flats = [slice(first[k], last[k] + 1) for k in np.flatnonzero((column[first] == level) & (long >= FLAT))]
        # An encoder also shows equal values where its angle turns.
        times = sum((sign * (modelled[flat] - level)).max() > step for flat in flats)
        if times >= FLATS:
            saturated = True
            yield f"{name} is cut off at {level:.4g} (SI), {times} times: it saturates, and values {side} are lost"
    if saturated:
        return
    longest = int(np.argmax(long))
    span = slice(first[longest], last[longest] + 1)
    follows = moving[span].mean() > 0.5 and np.ptp(modelled[span]) > hidden
    if follows and time[last[longest]] - time[first[longest]] > STUCK:
        yield f"{name} is stuck from {time[first[longest]]:.4g} to {time[last[longest]]:.4g} s, at {column[first[longest]]:.4g} (SI)"
