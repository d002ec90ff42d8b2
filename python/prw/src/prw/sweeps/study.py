"""The runs of a sweep, and how they are made."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import fmu_run
import numpy as np

from prw.motion import Array, Motion
from prw.parameters import Given, values_of
from prw.testbed import OUTPUTS, Testbed, driven_by, stopped

if TYPE_CHECKING:
    import pyarrow as pa

#: The statistics of each output in a result.
MEASURES: tuple[fmu_run.Measure, ...] = ("peak", "rms", "end")
#: Neighbouring runs, (first, last + 1). An interruption loses the chunks that are in work.
Chunk = tuple[int, int]
#: Chunks in a study, with at least and at most so many runs each.
CHUNKS, SHORTEST_CHUNK, LONGEST_CHUNK = 16, 16, 256


@dataclass(frozen=True)
class Study:
    """The runs of a sweep. fmu: the FMU file's content. motion: of the motors. names: parameters that vary; table: their
    values in SI, (runs, len(names)). fixed: values of others. key: a hash of all this."""

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

    def chunks(self) -> list[Chunk]:
        """All runs in chunks. The chunks depend only on the number of runs, so that a repeated call finds its files."""
        total = len(self.table)
        size = min(LONGEST_CHUNK, max(SHORTEST_CHUNK, -(-total // CHUNKS)))
        return [(first, min(first + size, total)) for first in range(0, total, size)]

    def results(self, chunk: Chunk, errors: Mapping[int, str], measured: Sequence[Array]) -> pa.Table:
        """The table of a chunk. errors: message by run that failed. measured: (runs of the chunk,) by column."""
        import pyarrow as pa

        first, last = chunk
        failed = np.isin(np.arange(first, last), list(errors))
        columns = {
            "run": pa.array(range(first, last), pa.int64()),
            "status": ["failed" if one else "done" for one in failed],
            "message": [errors.get(run, "") for run in range(first, last)],
            **dict(zip(self.names, self.table[first:last].T)),
        }
        names = (f"{output}_{measure}" for output in OUTPUTS for measure in MEASURES)
        columns |= {name: pa.array(values, mask=failed) for name, values in zip(names, measured)}
        return pa.table(columns, metadata={"study": self.key})


def run_chunk(study: Study, testbed: Testbed, chunk: Chunk, threads: int) -> pa.Table:
    """Make the runs of the chunk with this number of threads."""
    first, last = chunk
    varied = dict(zip(study.names, study.table[first:last].T))
    runs = testbed.loaded.run(
        study.motion.time,
        outputs=OUTPUTS,
        measures=MEASURES,
        threads=threads,
        **driven_by(study.motion, {**study.fixed, **varied}),
    )
    errors = {first + run: stopped(message) for run, message in runs.errors.items()}
    return study.results(chunk, errors, [runs[name, measure] for name in OUTPUTS for measure in MEASURES])


def lost(study: Study, chunk: Chunk, message: str) -> pa.Table:
    """Results of a chunk of which every run failed with this message."""
    first, last = chunk
    nothing = np.zeros(last - first)
    return study.results(chunk, dict.fromkeys(range(first, last), message), [nothing] * len(OUTPUTS) * len(MEASURES))
