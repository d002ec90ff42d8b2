"""The return value of `prw.check`: the differences of a result from a reference, and possible causes."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from prw.checking.experiments import Experiment
from prw.checking.result import Result
from prw.columns import MOTORS, si_unit
from prw.errors import UserError, need, one_line
from prw.files import write_text
from prw.motion import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Times that differ by less than this, in s, are equal.
SAME_TIME = 1e-9
#: If a motor differs by more than this share of the largest angle or rate of both motors, a note tells the user to look at the inputs.
OTHER_MOTORS = 1e-2
#: Share of the reference's times that a result must cover to agree. Some tools do not write the last time.
COVERED = 0.95
#: Similarity from which the title of an unknown column is taken for a misspelt output.
MISSPELT = 0.85
#: Relative difference up to which the ratio of result and reference is taken for the factor of a wrong unit or sign.
NEAR = 0.02


class Difference(NamedTuple):
    """The difference of one output from the reference, all in `unit` except the time.

    Attributes
    ----------
    largest
        Largest difference.
    at
        Time of the largest difference, s.
    found, expected
        Value of the result and of the reference at that time.
    allowed
        Tolerance.
    unit
        SI unit.
    """

    largest: float
    at: float
    found: float
    expected: float
    allowed: float
    unit: str

    @property
    def agrees(self) -> bool:
        """Whether the difference is within the tolerance."""
        return self.largest <= self.allowed


@dataclass(frozen=True, repr=False)
class Agreement:
    """The differences of a result from an experiment.

    Attributes
    ----------
    source
        File of the result.
    experiment
        The reference experiment.
    interface
        Interface type whose tolerances are used.
    time
        (n,) s, the times of the reference that the result covers.
    found, expected
        (n,) by output, the result and the reference, SI.
    notes
        Notes for the user, for example on missing outputs.
    incomplete
        Why the result shows too little of the experiment to agree with it.
    """

    source: Path
    experiment: Experiment
    interface: str
    time: Array
    found: Mapping[str, Array]
    expected: Mapping[str, Array]
    notes: tuple[str, ...]
    incomplete: tuple[str, ...]

    @property
    def variables(self) -> dict[str, Difference]:
        """The difference of each output, by name."""
        tolerance, differences = self.experiment.tolerance[self.interface], {}
        for name, found in self.found.items():
            expected = self.expected[name]
            k = int(np.abs(found - expected).argmax())
            values = float(abs(found[k] - expected[k])), float(self.time[k]), float(found[k]), float(expected[k])
            differences[name] = Difference(*values, tolerance[name], si_unit(name))
        return differences

    @property
    def agrees(self) -> bool:
        """Whether every output that the result has is within its tolerance, and the result is not `incomplete`."""
        return not self.incomplete and not self.far

    @property
    def far(self) -> list[str]:
        """Names of the outputs that are not within their tolerance."""
        return [name for name, difference in self.variables.items() if not difference.agrees]

    @property
    def missing(self) -> list[str]:
        """Names of the experiment's outputs that the result does not have."""
        return [name for name in self.experiment.outputs if name not in self.found]

    def summary(self) -> str:
        """The compared files and the difference of each output, in a few lines."""
        times = "1 time" if len(self.time) == 1 else f"{len(self.time)} times"
        lines = [
            f"compared    {one_line(str(self.source))} with {self.experiment.name} ({self.experiment.description})",
            f"            {times}, {self.time[0]:g} to {self.time[-1]:g} s, tolerances for {self.interface}",
        ]
        for name, found in self.variables.items():
            verdict = "" if found.agrees else f"   TOO FAR: {found.found:.6g} instead of {found.expected:.6g}"
            off = f"off by {found.largest:.2g} {found.unit} at {found.at:g} s, allowed {found.allowed:.2g}"
            lines.append(f"  {name:<10} {off}{verdict}")
        return "\n".join([*lines, *(f"note        {note}" for note in self.notes)])

    def to_json(self, path: str | os.PathLike[str] | None = None) -> str:
        """The differences and the notes as JSON, also written to `path` if it is given."""
        content = {
            "result": str(self.source),
            "experiment": self.experiment.name,
            "interface": self.interface,
            "agrees": self.agrees,
            "from": float(self.time[0]),
            "to": float(self.time[-1]),
            "times": len(self.time),
            "variables": {
                name: {**difference._asdict(), "agrees": difference.agrees}
                for name, difference in self.variables.items()
            },
            "notes": list(self.notes),
            "incomplete": list(self.incomplete),
        }
        return write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")

    def plot(self) -> Figure:
        """Result and reference of the outputs that do not agree, or of all if they do; save it with `.savefig(path)`.
        Raises UserError without matplotlib."""
        need("matplotlib")
        from prw.plots import Panel, draw_panels

        differences = self.variables
        panels = []
        for name in self.far or list(differences):
            curves = [("reference", self.expected[name]), ("result", self.found[name])]
            found = differences[name]
            off = f"{name}: off by {found.largest:.2g} at {found.at:g} s, allowed {found.allowed:.2g}"
            panels.append(Panel(off, found.unit.replace(".", " "), curves))
        return draw_panels(f"{one_line(self.source.name)} and {self.experiment.name}", self.time, panels, 1.9)

    def __repr__(self) -> str:
        return self.summary()

    def _repr_html_(self) -> str:
        rows = []
        for name, found in self.variables.items():
            verdict = "agrees" if found.agrees else "<strong>too far</strong>"
            cells = [name, f"{found.largest:.2g}", f"{found.allowed:.2g}", found.unit, f"{found.at:g}"]
            rows.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + f"<td>{verdict}</td></tr>")
        head = "".join(f"<th>{h}</th>" for h in ("output", "off by", "allowed", "unit", "at (s)", ""))
        notes = "".join(f"<p>{escape(note)}</p>" for note in self.notes)
        notes += "".join(f"<p><strong>does not agree:</strong> {escape(reason)}</p>" for reason in self.incomplete)
        return f"<p>{escape(self.experiment.name)}</p><table><tr>{head}</tr>{''.join(rows)}</table>{notes}"


def compare(result: Result, experiment: Experiment, interface: str) -> Agreement:
    """Compare the result with the experiment. Raises UserError if they have no output or no time in common."""
    time = _common_times(result, experiment)
    if not time.size:
        raise UserError(
            f"{result.source}: runs from {result.time[0]:g} to {result.time[-1]:g} s, {experiment.name} from 0 to "
            f"{experiment.stop_time:g} s; start the run at 0, and look at the unit of time"
        )
    names = [name for name in experiment.outputs if name in result.values]
    if not names:
        raise UserError(f"{result.source}: has none of the outputs {', '.join(experiment.outputs)}")
    at = np.isin(experiment.reference["time"], time)
    expected = {name: experiment.reference[name][at] for name in names}
    found = {name: interpolated(result.time, result.values[name], time) for name in names}
    bare = Agreement(result.source, experiment, interface, time, found, expected, (), ())
    return replace(bare, notes=tuple(_notes(bare, result)), incomplete=tuple(_incomplete(bare, result)))


def nearest(result: Result, known: Sequence[Experiment]) -> Experiment:
    """The experiment whose motors and outputs are nearest to the motors and outputs of the result."""

    def distance(experiment: Experiment) -> float:
        time, shares = _common_times(result, experiment), []
        if not time.size:
            return np.inf
        for columns in (experiment.inputs, experiment.reference):
            for name in sorted({*columns} & {*result.values}):
                true = np.interp(time, columns["time"], columns[name])
                off = interpolated(result.time, result.values[name], time) - true
                # At most 1, so that a column in another unit does not outweigh all others.
                shares.append(min(np.abs(off).max() / (np.abs(true).max() + 1e-3), 1.0))
        return float(np.mean(shares)) if shares else np.inf

    return min(known, key=distance)


def interpolated(time: Array, values: Array, at: Array) -> Array:
    """Values (n,) at the times `time` (n,), interpolated to the times `at` (m,): the value of the row with that time, if there
    is one, else the cubic through the four nearest rows."""
    count = min(4, len(time))
    first = np.clip(np.searchsorted(time, at) - count // 2, 0, len(time) - count)
    nodes = first[:, None] + np.arange(count)
    t = time[nodes]
    found = np.zeros(len(at))
    for i in range(count):
        others = [j for j in range(count) if j != i]
        weight = np.prod((at[:, None] - t[:, others]) / (t[:, [i]] - t[:, others]), axis=1)
        found += weight * values[nodes[:, i]]
    # The value of a row is taken as it is, even if its time differs by a rounding error.
    near = np.clip(np.searchsorted(time, at - SAME_TIME), 0, len(time) - 1)
    same = np.abs(time[near] - at) <= SAME_TIME
    return np.where(same, values[near], found)


def _common_times(result: Result, experiment: Experiment) -> Array:
    time = experiment.reference["time"]
    inside: Array = time[(time >= result.time[0] - SAME_TIME) & (time <= result.time[-1] + SAME_TIME)]
    return inside


def _incomplete(bare: Agreement, result: Result) -> Iterator[str]:
    """Reasons why small differences would not show that the result agrees with the experiment."""
    experiment, tolerance = bare.experiment, bare.experiment.tolerance[bare.interface]
    if len(bare.time) < COVERED * len(experiment.reference["time"]):
        yield f"it has only {bare.time[0]:g} to {bare.time[-1]:g} s of 0 to {experiment.stop_time:g} s"
    moving = [n for n in experiment.outputs if np.ptp(experiment.reference[n]) > tolerance[n]]
    if not {*moving} & {*bare.found}:
        yield f"no output that it has moves in this experiment; {', '.join(moving)} do, at least one is needed"
    for name in bare.missing:
        for title in get_close_matches(name, result.unknown, 1, MISSPELT):
            yield f"its column {title} is not known; name it {name} if it is that, else differently"


def _notes(bare: Agreement, result: Result) -> list[str]:
    """Notes on missing times and outputs, and on possible causes of differences."""
    experiment, notes = bare.experiment, []
    if bare.time[0] > 0 or bare.time[-1] < experiment.stop_time - SAME_TIME:
        span = f"{bare.time[0]:g} to {bare.time[-1]:g} s"
        notes.append(f"the result has only {span} of the experiment's 0 to {experiment.stop_time:g} s")
    if bare.missing:
        notes.append(f"not in the result: {', '.join(bare.missing)}")
    owners = {name: result.owners.get(name, "") for name in bare.found}
    if len({*owners.values()}) > 1:
        each = ", ".join(f"{name} of {owner or 'none'}" for name, owner in owners.items())
        notes.append(f"the outputs are of several components: {each}; `component` chooses one")
    if not bare.far:
        return notes
    for name in MOTORS:
        if name in result.values:
            true = np.interp(bare.time, experiment.inputs["time"], experiment.inputs[name])
            off = np.abs(interpolated(result.time, result.values[name], bare.time) - true)
            largest = max(np.abs(experiment.inputs[other]).max() for other in MOTORS if other[0] == name[0])
            if off.max() > OTHER_MOTORS * largest:
                notes.append(
                    f"{name} differs from {experiment.name}: off by {off.max():.2g} {si_unit(name)} at "
                    f"{bare.time[off.argmax()]:g} s; look at the inputs first"
                )
    for name, difference in bare.variables.items():
        expected, found = bare.expected[name], bare.found[name]
        if difference.agrees or not (power := expected @ expected):
            continue
        ratio = float(found @ expected / power)
        if abs(ratio / np.rad2deg(1) - 1) < NEAR:
            notes.append(f"{name} looks like degrees; give its unit: {name}=deg{'/s' * name.endswith('rate')}")
        elif abs(ratio + 1) < NEAR:
            notes.append(f"{name} has the other sign")
    late = _late_by(bare, result)
    if late:
        notes.append(f"everything agrees if the result is taken {late:g} s later: is a connection delayed?")
    return notes


def _late_by(bare: Agreement, result: Result) -> float:
    """The communication step (s) by which the result is late, if everything agrees after a shift by this step, else 0.
    Tries the steps of both interface types, and the median step of the result."""
    for step in {*bare.experiment.step.values(), float(np.median(np.diff(result.time)))}:
        inside = bare.time + step <= result.time[-1] + SAME_TIME
        allowed = bare.experiment.tolerance[bare.interface]
        if inside.any() and all(
            np.abs(interpolated(result.time, result.values[name], bare.time[inside] + step) - expected[inside]).max()
            <= allowed[name]
            for name, expected in bare.expected.items()
        ):
            return step
    return 0.0
