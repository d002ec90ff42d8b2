"""What `prw identify` does: read, fit, judge, report."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import List

import numpy as np
from threadpoolctl import threadpool_limits

from prw.errors import UserError
from prw.identify import options
from prw.identify.advice import advice
from prw.channels import MEASURED, QUANTITIES, factor, si_unit
from prw.identify.experiment import LONGEST_STEP, prepare
from prw.identify.exports import write_json, write_parameters, write_ssv, write_text
from prw.identify.fit import Prior, Task, fit
from prw.identify.measurements import read
from prw.identify.model import Model
from prw.identify.report import page
from prw.identify.results import Findings, numbers
from prw.identify.statistics import certainty

#: From this standard error on, a number is no estimate.
HOPELESS = 1.0


def identify(arguments: argparse.Namespace) -> None:
    """Carry out `prw identify`. Raises UserError with one line on what is wrong."""
    # Many small matrices: more threads only get into each other's way.
    with Model(arguments.fmu) as model, threadpool_limits(1):
        task = task_of(arguments, model)
        quantum = _quantum(arguments.quantum)
        step = LONGEST_STEP if arguments.step is None else options.number(str(arguments.step), "--step") / 1e3
        if arguments.starts < 1:
            raise UserError(f"--starts {arguments.starts}: at least 1 is needed")
        units = options.pairs([arguments.units], "--units")
        options.names(",".join(units) or "time", list(QUANTITIES), "--units")
        measured = [read(path, units, arguments.degrees) for path in arguments.files]
        there = tuple(dict.fromkeys(name for m in measured for name in m.channels))
        options.names(",".join(task.noise) or there[0], there, "--noise")
        experiments = [prepare(m, quantum, step) for m in measured]
        solution = fit(model, experiments, task, arguments.starts, arguments.seed)
        sure = certainty(solution)
        hints = advice(model, experiments, solution) if sure.undetermined else []
        findings = Findings(model, arguments.files, measured, experiments, solution, sure, hints)
        _write(arguments.out, findings)
    print("\n".join(_summary(arguments, findings)))
    if sure.undetermined:
        what = "; ".join(str(combination) for combination in sure.undetermined)
        raise UserError(
            f"{what}. What would settle it: {'; or '.join(hints)}. {arguments.out / 'report.html'} has the rest; "
            "identified.json was not written"
        )


def task_of(arguments: argparse.Namespace, model: Model) -> Task:
    """The task that the options describe."""
    known = list(model.parameters)
    fixed = f"; {', '.join(model.counts)} are counted, not estimated" if model.counts else ""
    start = {**model.starts, **options.numbers(arguments.set, known, "--set")}
    found = options.spreads(getattr(arguments, "prior", []), start, "--prior")
    estimate = options.names(arguments.estimate, known, "--estimate", fixed)
    chosen = tuple(name for name in known if name in estimate or name in found)
    for name in chosen:
        if start[name] <= 0:
            raise UserError(
                f"{name} starts at {start[name]:g} and cannot be estimated from there; add --set {name}=VALUE"
            )
    return Task(
        chosen,
        start,
        options.bounds(getattr(arguments, "bounds", []), start),
        {name: Prior(*prior) for name, prior in found.items()},
        options.numbers(arguments.noise, list(MEASURED), "--noise"),
        not getattr(arguments, "no_offsets", False),
        not getattr(arguments, "rest", False),
    )


def _quantum(text) -> float:
    if text is None:
        return 0.0
    match = re.fullmatch(r"\s*([-+.\deE]+)\s*([^\d\s].*)?", text)
    if not match:
        raise UserError(f"--quantum {text}: write an angle like 0.036deg")
    return options.number(match.group(1), "--quantum") * factor("theta1", match.group(2) or "rad")


def _write(out: Path, findings: Findings) -> None:
    """The report always; the parameters only if the data determine them, and never beside another fit's report."""
    identified, ssv = out / "identified.json", out / "identified.ssv"
    write_text(out / "report.html", page(findings))
    write_json(out / "report.json", numbers(findings))
    if findings.sure.undetermined:
        identified.unlink(missing_ok=True)
        ssv.unlink(missing_ok=True)
        return
    write_parameters(identified, findings.model, findings.solution.values)
    write_ssv(ssv, findings.model, findings.solution.values, "identified")


def _summary(arguments: argparse.Namespace, findings: Findings) -> List[str]:
    """What was found, one line each."""
    solution, sure = findings.solution, findings.sure
    files = ", ".join(map(str, arguments.files))
    channels = ", ".join(dict.fromkeys(name for e in findings.experiments for name in e.channels))
    seconds = sum(e.time[-1] - e.time[0] for e in findings.experiments)
    lines = [f"identified  from {files}: {seconds:.4g} s with {channels}"]
    for i, name in enumerate(solution.task.names):
        parameter = findings.model.parameters[name]
        value, low, high = (v / parameter.factor for v in (solution.values[name], sure.low[i], sure.high[i]))
        prior = ", prior" if name in solution.task.priors else ""
        sureness = f"+- {sure.relative[i]:.2%}   95 % interval {low:.5g} to {high:.5g}"
        if sure.relative[i] > HOPELESS:
            sureness = "not determined"
        lines.append(f"  {name:<9} {value:.5g} {parameter.shown}  {sureness}{prior}")
    lines.append(
        "noise       " + ", ".join(f"{name} {value:.2g} {si_unit(name)}" for name, value in solution.noise.items())
    )
    lines += [f"note        {note}" for note in findings.notes()]
    names = ["report.html", "report.json"] + ([] if sure.undetermined else ["identified.json", "identified.ssv"])
    lines.append(f"wrote       {', '.join(str(arguments.out / name) for name in names)}")
    if not sure.undetermined:
        lines.append(
            "next        look at the report; then: cargo run --release --bin build_fmu -- "
            f"--parameters {arguments.out / 'identified.json'} --out mine"
        )
    return lines
