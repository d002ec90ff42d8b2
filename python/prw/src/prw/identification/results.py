"""The return value of `prw.identify`, as text, JSON and files."""

from __future__ import annotations

import json
import os
from html import escape
from typing import Any

import numpy as np

from prw.columns import MOTORS, si_unit
from prw.errors import need
from prw.files import write_text
from prw.identification.findings import Findings


class Identification(Findings):
    """Result of identifying the parameters of the FMU `fmu` from `files`.

    Attributes
    ----------
    known
        The FMU's parameters.
    solution, sure
        The fit and its statistics.
    explanation
        The verdict, and possible causes if the model alone does not explain the data.
    parts
        Fits of parts of the recordings, if only these fit because a parameter changes over time.
    advice
        Experiments that would determine undetermined combinations.
    assumed, stopped
        The causes that `follow` has included, step by step, and why it took no further step.
    """

    def summary(self, *, command: bool = False) -> str:
        """The result in a few lines, in SI. command: whether remedies are options of `prw identify` instead of arguments."""
        channels = ", ".join(dict.fromkeys(name for e in self.experiments for name in e.channels))
        seconds = sum(e.sampled[-1] - e.sampled[0] for e in self.experiments)
        lines = [f"identified  from {', '.join(self.files)}: {seconds:.4g} s with {channels}"]
        if self.fits:
            lines.append(
                "verdict     the FMU explains the data"
                + f", together with {' and '.join(self.additions)}" * bool(self.additions)
                + ", if the steps that the notes list are assumed" * bool(self.assumed)
            )
        else:
            lines.append("verdict     THE FMU DOES NOT EXPLAIN THE DATA; the values below are not reliable")
            lines += [f"  {misfit}" for misfit in self.misfits]
            causes = self.diagnosis_in(command=command) or [self.unknown_cause]
            lines += [
                f"{'perhaps' if i or len(causes) == 1 else 'try first':<12}{cause}" for i, cause in enumerate(causes)
            ]
        for name, found in self.parameters.items():
            estimate, _, low, high = found.rounded()
            sureness = f"+- {found.relative:.2%}   95 % interval {low} to {high}"
            sureness = "not determined" if found.hopeless else sureness
            lines.append(f"  {name:<9} {estimate} {found.unit}  {sureness}{', prior' if found.prior else ''}")
        for name, pair in self.distortions.items():
            lines.append("  " + ": ".join(self.kind_of(name).worded(name, *pair)))
        noise = (f"{name} {value:.2g} {si_unit(name)}" for name, value in self.solution.noise.items())
        lines.append("noise       " + ", ".join(noise))
        return "\n".join([*lines, *(f"note        {note}" for note in self.notes)])

    def report(self, path: str | os.PathLike[str], *, command: bool = False) -> None:
        """Write the report, an HTML page that loads no other file: verdict, estimates, notes, residuals. command: whether remedies are
        options of `prw identify` instead of arguments. Raises UserError without jinja2 or matplotlib, or if the file cannot be
        written."""
        need("jinja2", "matplotlib")
        from prw.identification.report import page

        write_text(path, page(self, command=command))

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
                "additions": self.additions,
                "assumed": list(self.assumed),
                "stopped": self.stopped,
                "tried": [
                    {"fault": str(f.hypothesis), "size": f.size, "standard_error": f.error} for f in self.verdict.faults
                ],
                "fitted": list(self.explanation.tried),
                "not_fitted": list(self.explanation.left_out),
            },
            "parts": [
                {
                    "begin": part.begin,
                    "end": part.end,
                    "parameters": {n: part.value(n) for n in part.solution.task.names},
                }
                for part in self.parts
            ],
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
