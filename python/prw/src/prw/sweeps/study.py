"""What a sweep consists of, and how its runs are made."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import fmu_run
import numpy as np

from prw.motion import Array, Motion
from prw.parameters import Given, values_of
from prw.testbed import OUTPUTS, Testbed, driven_by, stopped

#: What is kept of each output's course.
MEASURES: tuple[fmu_run.Measure, ...] = ("peak", "rms", "end")
#: Neighbouring runs, (first, last + 1), and what came of runs.
Chunk = tuple[int, int]
Rows = list[dict[str, Any]]


@dataclass(frozen=True)
class Study:
    """fmu: the FMU file's content. motion: what the motors do. names: parameters that vary; table: their values in SI,
    (runs, len(names)). fixed: values of others. key: a hash of all this."""

    fmu: bytes
    motion: Motion
    names: tuple[str, ...]
    table: Array
    fixed: Mapping[str, Any] = field(default_factory=dict)
    key: str = field(init=False)

    @classmethod
    def of(cls, testbed: Testbed, motion: Motion, values: Mapping[str, Array], parameters: Given) -> Study:
        """The study of this FMU with the `values` (runs,) by parameter."""
        fixed = {name: value for name, value in values_of(parameters, testbed.loaded).items() if name not in values}
        return cls(testbed.fmu.read_bytes(), motion, tuple(values), np.column_stack(list(values.values())), fixed)

    def __post_init__(self) -> None:
        digest = hashlib.sha256(self.fmu)
        arrays = [self.motion.time, self.motion.theta, self.motion.omega, self.table]
        for array in arrays:
            if array is not None:
                digest.update(np.ascontiguousarray(array).tobytes() + b"|")
        digest.update(",".join((*self.names, *MEASURES, *OUTPUTS)).encode())
        if self.fixed:
            digest.update(repr(sorted(self.fixed.items())).encode())
        object.__setattr__(self, "key", digest.hexdigest()[:16])

    def columns(self) -> list[str]:
        """Names of a result's columns after `run`, `status` and `message`."""
        return [*self.names, *(f"{output}_{measure}" for output in OUTPUTS for measure in MEASURES)]


def run_chunk(study: Study, testbed: Testbed, chunk: Chunk, threads: int) -> Rows:
    """Results of the runs of the chunk, made by so many threads."""
    first, last = chunk
    table = study.table[first:last]
    runs = testbed.loaded.run(
        study.motion.time,
        outputs=OUTPUTS,
        measures=MEASURES,
        threads=threads,
        **driven_by(study.motion, {**study.fixed, **dict(zip(study.names, table.T))}),
    )
    errors = runs.errors
    columns = [runs[name, measure].tolist() for name in OUTPUTS for measure in MEASURES]
    rows = []
    for number, values, measured in zip(range(first, last), table.tolist(), zip(*columns)):
        if number - first in errors:
            rows.append(failed(study, number, stopped(errors[number - first])))
        else:
            done = {"run": number, "status": "done", "message": ""}
            rows.append({**done, **dict(zip(study.columns(), (*values, *measured)))})
    return rows


def failed(study: Study, number: int, message: str) -> dict[str, Any]:
    """The result of a run that could not be finished."""
    values = dict(zip(study.names, study.table[number].tolist()))
    return {**dict.fromkeys(study.columns()), "run": number, "status": "failed", "message": message, **values}


def chunks(missing: Sequence[int], size: int) -> list[Chunk]:
    """Runs that are not done yet, in chunks of at most `size`."""
    found: list[Chunk] = []
    for number in missing:
        if found and found[-1][1] == number and number - found[-1][0] < size:
            found[-1] = (found[-1][0], number + 1)
        else:
            found.append((number, number + 1))
    return found
