"""All that came out of a fit, in one place, and the doubts that a careful reader would have."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Sequence

import numpy as np

from prw.channels import MOTORS, si_unit
from prw.identify.experiment import Experiment
from prw.identify.fit import Solution
from prw.identify.measurements import Measurements
from prw.identify.model import Model
from prw.identify.statistics import Certainty

#: Residuals this much stronger than the noise that was given, or weaker by as much, are worth a word.
UNLIKE = 1.5
#: A channel of which less than this share is explained (1 - |residual| / |motion|) does not fit.
POOR_FIT = 0.5
#: An estimate that is off its prior by this many standard deviations contradicts it.
CONTRADICTION = 3.0


class ChannelFit(NamedTuple):
    """How one channel of one experiment came out. count: of values. noise: strength in the band, residual: rms over
    all frequencies, offset: of the sensor, all SI. explained: share of its motion. band: Hz."""

    experiment: str
    channel: str
    unit: str
    count: int
    noise: float
    residual: float
    offset: float
    explained: float


@dataclass(frozen=True)
class Findings:
    """The fit of `files`, with what it was made of. hints: what would settle open combinations."""

    model: Model
    files: Sequence[Path]
    measured: Sequence[Measurements]
    experiments: Sequence[Experiment]
    solution: Solution
    sure: Certainty
    hints: Sequence[str]

    def residual(self, i: int) -> np.ndarray:
        """Measured minus modelled of experiment i, (n, c), SI, NaN where nothing was measured."""
        return self.experiments[i].values - self.solution.evaluation.modelled[i]

    def channels(self) -> List[ChannelFit]:
        """How every channel of every experiment came out."""
        found = []
        for i, experiment in enumerate(self.experiments):
            residual = self.residual(i)
            for j, name in enumerate(experiment.channels):
                values = experiment.values[:, j]
                spread = np.nanstd(values)
                rms = float(np.sqrt(np.nanmean(residual[:, j] ** 2)))
                found.append(
                    ChannelFit(
                        experiment.name,
                        name,
                        si_unit(name),
                        int(np.isfinite(values).sum()),
                        self.solution.noise[name],
                        rms,
                        float(self.solution.evaluation.offsets[i][j]),
                        float(1 - rms / spread) if spread > 0 else 0.0,
                    )
                )
        return found

    def notes(self) -> List[str]:
        """What the user should know or doubt, one line each."""
        solution, sure = self.solution, self.sure
        lines = [f"{m.source}: {note}" for m in self.measured for note in m.notes]
        for name in solution.task.names:
            low, high = solution.task.bounds[name]
            if min(solution.values[name] / low, high / solution.values[name]) < 1.001:
                lines.append(f"{name} ended at its bound; widen it with --bounds, or doubt the data")
        for point, _ in solution.rivals:
            values = ", ".join(
                f"{name} {value / self.model.parameters[name].factor:.4g}"
                for name, value in zip(solution.task.names, np.exp(point))
            )
            swapped = " (the couplings exchanged)" if self._exchanged(point) else ""
            lines.append(
                f"the data fit as well with {values}{swapped}; given is what is nearest to the start values. "
                "theta3 and theta4 would tell"
            )
        for channel in self.channels():
            if channel.explained < POOR_FIT and channel.channel not in solution.task.noise:
                lines.append(
                    f"{channel.experiment}: {channel.channel} fits badly ({channel.explained:.0%} of its motion is "
                    "explained); check its unit and sign, and whether the motors move it at all"
                )
            given = solution.task.noise.get(channel.channel)
            if given and not 1 / UNLIKE < self._actual(channel.channel) / given < UNLIKE:
                lines.append(
                    f"{channel.channel}: its residuals are {self._actual(channel.channel) / given:.2g} times the noise "
                    "that was given"
                )
        for name, prior in solution.task.priors.items():
            off = np.log(solution.values[name] / prior.value) / prior.relative
            if abs(off) > CONTRADICTION:
                lines.append(
                    f"{name} came out {abs(off):.1f} standard deviations off its prior; data and prior disagree"
                )
        if (sure.whiteness > UNLIKE).any() and not sure.undetermined:
            lines.append("the noise is not white (quantised angles do that); the standard errors take it into account")
        return list(dict.fromkeys(lines))

    def _actual(self, name: str) -> float:
        """Strength of a channel's residuals in the band, SI."""
        squares = counts = 0.0
        for experiment, residual in zip(self.experiments, self.solution.evaluation.residuals):
            if name in experiment.channels:
                column = residual[:, experiment.channels.index(name)]
                squares, counts = squares + column @ column, counts + len(column) - 1
        return float(np.sqrt(squares / counts) * self.solution.noise[name])

    def _exchanged(self, point: np.ndarray) -> bool:
        place = {name: i for i, name in enumerate(self.solution.task.names)}
        return all(
            abs(point[place[a]] - self.solution.logarithms[place[b]]) < 0.05
            for a, b in (("k1", "k2"), ("k2", "k1"), ("c1", "c2"), ("c2", "c1"))
            if a in place and b in place
        )


def numbers(findings: Findings) -> Dict[str, Any]:
    """The report's content for other programs; values in SI and in the unit that the FMU shows."""
    solution, sure = findings.solution, findings.sure
    parameters = {}
    for name, parameter in findings.model.parameters.items():
        entry: Dict[str, Any] = {
            "value": solution.values[name],
            "unit": parameter.unit,
            "shown": {"value": solution.values[name] / parameter.factor, "unit": parameter.shown},
            "start": solution.task.start[name],
            "estimated": name in solution.task.names,
        }
        if name in solution.task.names:
            i = solution.task.names.index(name)
            entry["standard_error"] = solution.values[name] * float(sure.relative[i])
            entry["relative_standard_error"] = float(sure.relative[i])
            entry["interval_95"] = [float(sure.low[i]), float(sure.high[i])]
            entry["bounds"] = list(solution.task.bounds[name])
            if name in solution.task.priors:
                prior = solution.task.priors[name]
                entry["prior"] = {"value": prior.value, "relative": prior.relative}
        parameters[name] = entry
    return {
        "fmu": {"file": str(findings.model.fmu), "guid": findings.model.guid},
        "files": [str(path) for path in findings.files],
        "identified": not sure.undetermined,
        "parameters": parameters,
        "correlation": {"names": list(sure.names), "matrix": sure.correlation.tolist()},
        "information": {
            "matrix_of_logarithms": sure.information.tolist(),
            "condition": sure.condition,
            "undetermined": [
                {"shares": dict(c.shares), "error_of_logarithm": min(c.error, 1e6), "text": str(c)}
                for c in sure.undetermined
            ],
            "advice": list(findings.hints),
        },
        "channels": [channel._asdict() for channel in findings.channels()],
        "motors": [
            {
                "experiment": experiment.name,
                "motor": motor,
                "quantum": path.quantum,
                "noise": path.noise,
                "rate_noise": path.rate_noise,
                "path_follows_to_hz": path.follows,
                "compared_to_hz": min(experiment.band, 0.5 * (len(experiment.time) - 1) / np.ptp(experiment.time)),
            }
            for experiment in findings.experiments
            for motor, path in zip(MOTORS, experiment.paths or ())
        ],
        "rivals": [
            {"values": dict(zip(solution.task.names, np.exp(x).tolist())), "misfit_above_best": chi - solution.misfit}
            for x, chi in solution.rivals
        ],
        "misfit": solution.misfit,
        "starts": solution.tried,
        "simulations": solution.evaluations,
        "notes": findings.notes(),
    }
