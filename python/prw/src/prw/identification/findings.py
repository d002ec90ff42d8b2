"""The findings of `prw.identify`: estimates, standard errors, notes and warnings, as numbers and sentences."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from prw.columns import si_unit
from prw.identification.diagnosis import Explanation, Part, changes
from prw.identification.experiment import Experiment
from prw.identification.fit import Prior, Solution
from prw.identification.kinds import KINDS, Kind
from prw.identification.model import Parameters
from prw.identification.residuals import note_on_times, notes_on_residuals
from prw.identification.rounding import rounded
from prw.identification.statistics import Certainty
from prw.identification.verdict import Verdict, common_gain
from prw.motion import Array

#: If residuals and given noise differ by more than this factor, a note reports it.
UNLIKE = 1.5
#: An estimate that differs from its prior by this many standard deviations contradicts it.
CONTRADICTION = 3.0
#: Relative standard error above which a parameter is reported as not determined.
HOPELESS = 1.0


class Estimate(NamedTuple):
    """A parameter that was estimated.

    Attributes
    ----------
    value, standard_error
        In `unit`.
    interval
        Both ends of the 95 % interval, in `unit`.
    relative
        Standard error as a fraction of the value.
    unit
        SI unit.
    shown
        Display unit of the parameter in the FMU.
    factor
        Factor from the display unit to SI.
    prior
        Prior knowledge of the parameter, or None.
    """

    value: float
    standard_error: float
    interval: tuple[float, float]
    relative: float
    unit: str
    shown: str
    factor: float
    prior: Prior | None

    @property
    def hopeless(self) -> bool:
        """Whether the data hardly determine the parameter."""
        return self.relative > HOPELESS

    def rounded(self, factor: float = 1.0) -> list[str]:
        """Value, standard error and both ends of the interval, with the digits that the error justifies, in the unit that
        `factor` converts to SI."""
        return rounded(*(number / factor for number in (self.value, self.standard_error, *self.interval)))


class ChannelFit(NamedTuple):
    """The fit of one channel in one experiment.

    Attributes
    ----------
    experiment, channel
        Names of both.
    unit
        SI unit of the channel, and of `noise`, `residual` and `offset`.
    samples
        Number of values.
    noise
        Standard deviation of the noise in the compared band, without the steps of encoders, in `unit`.
    residual
        Root mean square of measured minus modelled values, over all frequencies, in `unit`.
    offset
        Estimated offset of the sensor, in `unit`.
    explained
        Share of the channel's motion that the model explains, or None if the motors do not move the channel.
    """

    experiment: str
    channel: str
    unit: str
    samples: int
    noise: float
    residual: float
    offset: float
    explained: float | None


@dataclass(frozen=True, repr=False)
class Findings:
    """Estimates of the parameters of one FMU, with notes on how reliable they are.
    `prw.identification.results.Identification` documents the attributes."""

    fmu: Path
    known: Parameters
    files: tuple[str, ...]
    experiments: tuple[Experiment, ...]
    solution: Solution
    sure: Certainty
    explanation: Explanation
    parts: tuple[Part, ...]
    advice: tuple[str, ...]
    assumed: tuple[str, ...] = ()
    stopped: str = ""

    @property
    def verdict(self) -> Verdict:
        """Whether the model explains the data, together with `additions`."""
        return self.explanation.verdict

    @property
    def additions(self) -> list[str]:
        """Properties of the rig that the FMU does not model and that the fit includes, with their sizes."""
        task, found = self.solution.task, []
        for d in task.distortions:
            if KINDS[d.kind].belongs:
                found.append(" of ".join(KINDS[d.kind].worded(str(d), *self.distortions[str(d)])))
        return found + ([f"slow drift of {', '.join(task.drift)}"] if task.drift else [])

    def kind_of(self, name: str) -> Kind:
        """The kind of a distortion in `distortions`, with its unit for messages."""
        return next(KINDS[d.kind] for d in self.solution.task.distortions if str(d) == name)

    @property
    def diagnosis(self) -> list[str]:
        """Possible causes if the model does not explain the data, the most likely first."""
        return self.diagnosis_in()

    def diagnosis_in(self, *, command: bool = False) -> list[str]:
        """The diagnosis, with remedies as options of the command if `command` is true, otherwise as arguments of Python."""
        if self.fits:
            return []
        found = [f"{change}: with that, each of these parts fits" for change in changes(self.parts)]
        if not self.explanation.known:
            found += filter(None, map(note_on_times, self.experiments, self.solution.modelled))
        return found + [cause.message(command) for cause in self.explanation.causes]

    @property
    def unknown_cause(self) -> str:
        """What was tried if no cause was found, and what was not."""
        tried = ", ".join([*self.explanation.tried, "changes over time, by fits of parts"])
        others = self.explanation.left_out
        not_tried = f"; not tried, because less was expected of them: {', '.join(others)}" if others else ""
        return f"no known cause; none of these explains the data: {tried}{not_tried}"

    @property
    def parameters(self) -> dict[str, Estimate]:
        """The estimates by name."""
        task, sure, found = self.solution.task, self.sure, {}
        for i, name in enumerate(task.names):
            parameter, value, relative = self.known.real[name], self.values[name], float(sure.relative[i])
            interval = float(sure.low[i]), float(sure.high[i])
            unit = parameter.unit, parameter.shown, parameter.factor
            found[name] = Estimate(value, value * relative, interval, relative, *unit, task.priors.get(name))
        return found

    @property
    def values(self) -> dict[str, float]:
        """All Real parameters of the FMU by name, in SI, including those that were not estimated."""
        return self.solution.values

    @property
    def distortions(self) -> dict[str, tuple[float, float]]:
        """Estimated distortions, such as delays (s), gains and friction (N.m), with their standard errors in SI, by name."""
        task, found = self.solution.task, {}
        for i, distortion in enumerate(task.distortions, len(task.names)):
            value = distortion.value(float(self.solution.logarithms[i]))
            unit = value if distortion.kind == "gain" else distortion.value(1.0)
            found[str(distortion)] = value, float(self.sure.relative[i]) * unit
        return found

    @property
    def fits(self) -> bool:
        """Whether the model explains the data. If not, the estimates are not the parameters of the testbed."""
        return self.verdict.fits

    @property
    def misfits(self) -> list[str]:
        """Descriptions of unexplained residuals by channel, with their frequencies; empty if the model fits."""
        several = len(self.experiments) > 1
        return [f"{misfit.experiment}: {misfit}" if several else str(misfit) for misfit in self.verdict.misfits]

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates, (p, p), in the order of `parameters`; distortions follow."""
        return self.sure.correlation

    @property
    def undetermined(self) -> list[str]:
        """Combinations of parameters that the data leave open; empty if all are determined."""
        return [str(combination) for combination in self.sure.undetermined]

    def residual(self, i: int) -> Array:
        """Measured minus modelled values of experiment i, (n, c), SI; NaN where no value was measured."""
        values = self.experiments[i].values
        assert values is not None
        return values - self.solution.modelled[i]

    @property
    def channels(self) -> list[ChannelFit]:
        """Results of every channel of every experiment."""
        found = []
        for i, experiment in enumerate(self.experiments):
            residual = self.residual(i)
            measured = residual + self.solution.modelled[i]
            for j, name in enumerate(experiment.channels):
                spread, rms = np.nanstd(measured[:, j]), float(np.sqrt(np.nanmean(residual[:, j] ** 2)))
                count = int(np.isfinite(residual[:, j]).sum())
                offset = float(self.solution.comparisons[i].offsets[j])
                noise = self.solution.noise[name]
                still = max(float(np.nanstd(self.solution.modelled[i][:, j])), float(spread) - rms) < rms / 2
                explained = None if still else float(1 - rms / spread) if spread > 0 else 0.0
                found.append(ChannelFit(experiment.name, name, si_unit(name), count, noise, rms, offset, explained))
        return found

    @property
    def notes(self) -> list[str]:
        """Notes and warnings for the user, one line each, in SI."""
        solution, sure = self.solution, self.sure
        lines = [f"{file}: {note}" for file, e in zip(self.files, self.experiments) for note in e.notes]
        lines += [f"assumed in step {i}: {cause}" for i, cause in enumerate(self.assumed, 1)]
        lines += [f"the next step was not taken: {self.stopped}"] if self.stopped else []
        for e, modelled in zip(self.experiments, solution.modelled):
            lines += notes_on_residuals(e, modelled)
        for name in solution.task.names:
            low, high = solution.task.bounds[name]
            if min(self.values[name] / low, high / self.values[name]) < 1.001:
                lines.append(f"the estimate of {name} is at its bound; give wider bounds, or check the data")
        for point, _ in solution.rivals:
            pairs = zip(solution.task.names, np.exp(point))
            values = ", ".join(f"{name} {value:.4g} {self.known.real[name].unit}" for name, value in pairs)
            swapped = self._exchanged(point)
            lines.append(
                f"other values fit the data equally well: {values}{' (the couplings exchanged)' if swapped else ''}; "
                "the result is the solution nearest to the start values"
            )
            if swapped:
                lines.append("measurements of theta3 and theta4 distinguish solutions with exchanged couplings")
        first = self.verdict.suggested
        if self.fits and first is not None and not sure.undetermined:
            lines.append(f"intervals allow for a {first}, which the data suggest but do not prove")
        if gain := common_gain(solution):
            lines.append(
                f"a gain of all torques of {np.exp(gain):.4g} has the same effect as inertias that differ from the start values by "
                f"{np.expm1(gain):+.1%}; the intervals contain both. To decide, weigh the parts, or load the torque sensors with a known "
                "torque"
            )
        if self.fits:
            lines += [
                f"the data fit about as well with another cause: {c.message()}"
                for c in self.explanation.causes
                if c.hint
            ]
        for name in solution.task.noise:
            times = self._times_its_noise(name)
            if not 1 / UNLIKE < times < UNLIKE:
                lines.append(f"{name}: its residuals are {float(f'{times:.2g}'):g} times the noise that was given")
        for name, estimate in self.parameters.items():
            if estimate.prior is not None:
                off = abs(np.log(estimate.value / estimate.prior.value)) / estimate.prior.relative
                if off > CONTRADICTION:
                    lines.append(
                        f"{name} differs from its prior by {off:.1f} standard deviations; data and prior disagree"
                    )
        if (sure.whiteness > UNLIKE).any() and not sure.undetermined:
            lines.append(
                "the noise is not white, for example because angles are quantised; the standard errors take this into account"
            )
        return list(dict.fromkeys(lines))

    def _times_its_noise(self, name: str) -> float:
        """Ratio of a channel's residuals in the band to the expectation from noise and encoders."""
        columns = [
            comparison.residual[..., experiment.channels.index(name)].ravel()
            for experiment, comparison in zip(self.experiments, self.solution.comparisons)
            if name in experiment.channels
        ]
        return float(np.sqrt(np.mean(np.concatenate(columns) ** 2)))

    def _exchanged(self, point: Array) -> bool:
        """Whether a solution has the estimated values with the two couplings exchanged."""
        index = {name: i for i, name in enumerate(self.solution.task.names)}
        pairs = [(a, b) for a, b in (("k1", "k2"), ("k2", "k1"), ("c1", "c2"), ("c2", "c1")) if {a, b} <= index.keys()]
        differences = [abs(point[index[a]] - self.solution.logarithms[index[b]]) for a, b in pairs]
        return bool(pairs) and bool(max(differences) < 0.05)
