"""The return value of `prw.identify`: estimates, standard errors and doubts."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from prw.columns import MOTORS, si_unit
from prw.errors import need
from prw.files import write_text
from prw.identification.experiment import Experiment
from prw.identification.fit import Prior, Solution
from prw.identification.model import Parameters
from prw.identification.rounding import rounded
from prw.identification.statistics import Certainty
from prw.identification.verdict import Verdict
from prw.motion import Array

#: Factor between residuals and given noise that causes a note.
UNLIKE = 1.5
#: An estimate that is off its prior by this many standard deviations contradicts it.
CONTRADICTION = 3.0
#: Relative standard error above which a parameter is reported as not determined.
HOPELESS = 1.0


class Estimate(NamedTuple):
    """A parameter that was estimated. value, standard_error: in `unit` (SI), as are both ends of the 95 % `interval`.
    relative: standard error as a fraction. shown, factor: the display unit of the FMU, and the factor from that unit to SI.
    prior: its prior or None."""

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
    """Result of one channel of one experiment. samples: number of values. noise: in the band, without encoders' errors;
    residual: rms over all frequencies; offset: of the sensor; all SI. explained: share of its motion, or None if the
    motors do not move the channel."""

    experiment: str
    channel: str
    unit: str
    samples: int
    noise: float
    residual: float
    offset: float
    explained: float | None


@dataclass(frozen=True, repr=False)
class Identification:
    """Result of identifying the parameters of the FMU `fmu` from `files`.

    Attributes
    ----------
    known
        The FMU's parameters.
    solution, sure
        The fit and its statistics.
    verdict
        Whether the model explains the data.
    diagnosis
        Possible causes if the model does not explain the data.
    advice
        Experiments that would determine undetermined combinations.
    """

    fmu: Path
    known: Parameters
    files: tuple[str, ...]
    experiments: tuple[Experiment, ...]
    solution: Solution
    sure: Certainty
    verdict: Verdict
    diagnosis: tuple[str, ...]
    advice: tuple[str, ...]

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
        """All Real parameters of the FMU in SI by name, fixed ones included."""
        return self.solution.values

    @property
    def distortions(self) -> dict[str, tuple[float, float]]:
        """Estimated delays and lags (s) and gains with their standard errors, by name."""
        task, found = self.solution.task, {}
        for i, distortion in enumerate(task.distortions, len(task.names)):
            value = distortion.value(float(self.solution.logarithms[i]))
            unit = value if distortion.kind == "gain" else distortion.value(1.0)
            found[str(distortion)] = value, float(self.sure.relative[i]) * unit
        return found

    @property
    def fits(self) -> bool:
        """Whether the model explains the data. If not, they are not the testbed's parameters."""
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
        """Measured minus modelled of experiment i, (n, c), SI, NaN if missing."""
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
        """Notes and doubts for the user, one line each, in SI."""
        return self.notes_in(shown=False)

    def notes_in(self, *, shown: bool) -> list[str]:
        """Notes and doubts for the user, one line each; with `shown` parameters in display units."""
        solution, sure = self.solution, self.sure
        lines = [f"{file}: {note}" for file, e in zip(self.files, self.experiments) for note in e.notes]
        for name in solution.task.names:
            low, high = solution.task.bounds[name]
            if min(self.values[name] / low, high / self.values[name]) < 1.001:
                lines.append(f"{name} ended at its bound; give wider bounds, or doubt the data")
        for point, _ in solution.rivals:
            values = ", ".join(
                f"{name} {value / factor:.4g} {unit}"
                for name, value in zip(solution.task.names, np.exp(point))
                for factor, unit in [self._unit(name, shown)]
            )
            swapped = " (the couplings exchanged)" if self._exchanged(point) else ""
            lines.append(
                f"the data fit as well with {values}{swapped}; the result is the one nearest to the start values. "
                "theta3 and theta4 would distinguish them"
            )
        first = self.verdict.suggested
        if self.fits and first is not None and not sure.undetermined:
            lines.append(
                f"intervals allow for a {first.name} of {' +- '.join(rounded(first.size, first.error))} {first.unit}".rstrip()
                + ", which the data suggest but do not prove"
            )
        for name in solution.task.noise:
            times = self._times_its_noise(name)
            if not 1 / UNLIKE < times < UNLIKE:
                lines.append(f"{name}: its residuals are {float(f'{times:.2g}'):g} times the noise that was given")
        for name, estimate in self.parameters.items():
            if estimate.prior is not None:
                off = abs(np.log(estimate.value / estimate.prior.value)) / estimate.prior.relative
                if off > CONTRADICTION:
                    lines.append(
                        f"{name} came out {off:.1f} standard deviations off its prior; data and prior disagree"
                    )
        if (sure.whiteness > UNLIKE).any() and not sure.undetermined:
            lines.append("the noise is not white (quantised angles do that); the standard errors take it into account")
        return list(dict.fromkeys(lines))

    def summary(self, *, shown: bool = False) -> str:
        """The result in a few lines, in SI; with `shown` parameters in display units."""
        channels = ", ".join(dict.fromkeys(name for e in self.experiments for name in e.channels))
        seconds = sum(e.sampled[-1] - e.sampled[0] for e in self.experiments)
        lines = [f"identified  from {', '.join(self.files)}: {seconds:.4g} s with {channels}"]
        if self.fits:
            lines.append("verdict     the FMU explains the data")
        else:
            lines.append("verdict     THE FMU DOES NOT EXPLAIN THE DATA; the values below are not reliable")
            lines += [f"  {misfit}" for misfit in self.misfits]
            lines += [f"perhaps     {cause}" for cause in self.diagnosis or ["no known cause"]]
        for name, found in self.parameters.items():
            factor, unit = self._unit(name, shown)
            estimate, _, low, high = found.rounded(factor)
            sureness = f"+- {found.relative:.2%}   95 % interval {low} to {high}"
            sureness = "not determined" if found.hopeless else sureness
            lines.append(f"  {name:<9} {estimate} {unit}  {sureness}{', prior' if found.prior else ''}")
        for name, (value, error) in self.distortions.items():
            factor, unit = (1.0, "") if name.startswith("gain") else (1e3, " ms")
            lines.append(f"  {name}: {' +- '.join(rounded(value * factor, error * factor))}{unit}")
        noise = (f"{name} {value:.2g} {si_unit(name)}" for name, value in self.solution.noise.items())
        lines.append("noise       " + ", ".join(noise))
        return "\n".join([*lines, *(f"note        {note}" for note in self.notes_in(shown=shown))])

    def report(self, path: str | os.PathLike[str]) -> None:
        """Write the report, an HTML page that loads no other file: estimates, doubts, residuals. Raises UserError without
        jinja2 or matplotlib, or if the file cannot be written."""
        need("jinja2", "matplotlib")
        from prw.identification.report import page

        write_text(path, page(self))

    def to_json(self, path: str | os.PathLike[str] | None = None) -> str:
        """All numbers as JSON, also written to `path` if it is given."""
        return write_text(path, json.dumps(self._numbers(), indent=2, ensure_ascii=False, allow_nan=False) + "\n")

    def to_parameters(self, path: str | os.PathLike[str] | None = None) -> str:
        """All parameters as `build_fmu --parameters` reads them, in display units."""
        return write_text(path, self.known.for_building(self.values))

    def to_ssv(self, path: str | os.PathLike[str] | None = None, name: str = "identified") -> str:
        """All parameters as a parameter set of SSP 1.0, in SI, that other tools read. name: of the set."""
        return write_text(path, self.known.ssv(self.values, name))

    def __repr__(self) -> str:
        return self.summary()

    def _repr_html_(self) -> str:
        rows = []
        for name, found in self.parameters.items():
            value, error, low, high = found.rounded()
            cells = [name, value, f"± {error}", f"{low} to {high}", found.unit]
            cells = [name, "not determined", "", "", found.unit] if found.hopeless else cells
            rows.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>")
        head = "".join(f"<th>{h}</th>" for h in ("parameter", "estimate", "standard error", "95 % interval", "unit"))
        notes = "".join(
            f"<p>{escape(line)}</p>" for line in [*self.misfits, *self.diagnosis, *self.undetermined, *self.notes]
        )
        return f"<table><tr>{head}</tr>{''.join(rows)}</table>{notes}"

    def _unit(self, name: str, shown: bool) -> tuple[float, str]:
        """Factor and unit of a parameter: the display unit or SI."""
        parameter = self.known.real[name]
        return (parameter.factor, parameter.shown) if shown else (1.0, parameter.unit)

    def _times_its_noise(self, name: str) -> float:
        """Ratio of a channel's residuals in the band to the expectation from noise and encoders."""
        columns = [
            comparison.residual[..., experiment.channels.index(name)].ravel()
            for experiment, comparison in zip(self.experiments, self.solution.comparisons)
            if name in experiment.channels
        ]
        return float(np.sqrt(np.mean(np.concatenate(columns) ** 2)))

    def _exchanged(self, point: Array) -> bool:
        index = {name: i for i, name in enumerate(self.solution.task.names)}
        return all(
            abs(point[index[a]] - self.solution.logarithms[index[b]]) < 0.05
            for a, b in (("k1", "k2"), ("k2", "k1"), ("c1", "c2"), ("c2", "c1"))
            if a in index and b in index
        )

    def _numbers(self) -> dict[str, Any]:
        solution, sure, estimates = self.solution, self.sure, self.parameters
        parameters = {}
        for name, parameter in self.known.real.items():
            value = self.values[name]
            entry: dict[str, Any] = {
                "value": value,
                "unit": parameter.unit,
                "shown": {"value": value / parameter.factor, "unit": parameter.shown},
                "start": solution.task.start[name],
                "estimated": name in estimates,
            }
            if name in estimates:
                found = estimates[name]
                entry["standard_error"], entry["relative_standard_error"] = found.standard_error, found.relative
                entry["interval_95"], entry["bounds"] = found.interval, solution.task.bounds[name]
                if found.prior:
                    entry["prior"] = found.prior._asdict()
            parameters[name] = entry
        return {
            "fmu": {"file": str(self.fmu), "guid": self.known.guid},
            "files": list(self.files),
            "identified": self.fits and not sure.undetermined,
            "verdict": {
                "fits": self.fits,
                "misfits": [misfit._asdict() for misfit in self.verdict.misfits],
                "diagnosis": list(self.diagnosis),
                "tried": [
                    {"fault": f.name, "unit": f.unit, "size": f.size, "standard_error": f.error}
                    for f in self.verdict.faults
                ],
            },
            "distortions": {n: {"value": v, "standard_error": e} for n, (v, e) in self.distortions.items()},
            "parameters": parameters,
            "correlation": {"names": list(sure.names), "matrix": sure.correlation.tolist()},
            "information": {
                "matrix_of_logarithms": sure.information.tolist(),
                "condition": sure.condition,
                "undetermined": [
                    {"shares": dict(c.shares), "error_of_logarithm": min(c.error, 1e6), "text": str(c)}
                    for c in sure.undetermined
                ],
                "advice": list(self.advice),
            },
            "channels": [channel._asdict() for channel in self.channels],
            "motors": [
                {
                    "experiment": experiment.name,
                    "motor": motor,
                    "quantum": path.quantum,
                    "noise": path.noise,
                    "rate_noise": path.rate_noise,
                    "compared_to_hz": experiment.band,
                }
                for experiment in self.experiments
                for motor, path in zip(MOTORS, experiment.paths or ())
            ],
            "rivals": [
                {"values": dict(zip(sure.names, np.exp(x).tolist())), "misfit_above_best": chi - solution.misfit}
                for x, chi in solution.rivals
            ],
            "misfit": solution.misfit,
            "starts": solution.tried,
            "evaluations": solution.evaluations,
            "notes": self.notes,
        }
