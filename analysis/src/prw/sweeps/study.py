"""What a sweep consists of, and one run of it. Everything here is sent to the workers."""

from __future__ import annotations

import atexit
import hashlib
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import fmu_run
import numpy as np

from prw.motion import Array, Motion
from prw.testbed import OUTPUTS, Testbed, driven_by, stopped

#: What is kept of each output's course.
MEASURES: tuple[fmu_run.Measure, ...] = ("peak", "rms", "end")


@dataclass(frozen=True)
class Study:
    """fmu: the FMU file's content. motion: what the motors do. names: parameters that vary; table: their values in SI,
    (runs, len(names)). key: a hash of all this."""

    fmu: bytes
    motion: Motion
    names: tuple[str, ...]
    table: Array
    key: str = field(init=False)

    def __post_init__(self) -> None:
        digest = hashlib.sha256(self.fmu)
        arrays = [self.motion.time, self.motion.theta, self.motion.omega, self.table]
        for array in arrays:
            if array is not None:
                digest.update(np.ascontiguousarray(array).tobytes() + b"|")
        digest.update(",".join((*self.names, *MEASURES, *OUTPUTS)).encode())
        object.__setattr__(self, "key", digest.hexdigest()[:16])

    def columns(self) -> list[str]:
        """Names of a result's columns after `run`, `status` and `message`."""
        return [*self.names, *(f"{output}_{measure}" for output in OUTPUTS for measure in MEASURES)]


#: The study and the FMU of this worker process, kept from chunk to chunk.
_bench: dict[str, Any] = {}


def prepare(study: Study) -> None:
    """Load the study's FMU in this process, unless it is there already."""
    if _bench.get("key") == study.key:
        return
    _leave()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.fmu"
        path.write_bytes(study.fmu)
        testbed = Testbed(path)
    if not _bench:
        atexit.register(_leave)
    _bench.update(key=study.key, study=study, testbed=testbed)


def run_chunk(study: Study | None, first: int, last: int) -> list[dict[str, Any]]:
    """Results of runs first ... last - 1. study: or None where prepare() has been called in this process."""
    if study is not None:
        prepare(study)
    # The processes are the parallel part: one that dies costs the others nothing.
    return run_rows(_bench["study"], _bench["testbed"], first, last, threads=1)


def run_rows(study: Study, testbed: Testbed, first: int, last: int, threads: int | None) -> list[dict[str, Any]]:
    """Results of runs first ... last - 1 on so many threads; None: one for each processor."""
    table = study.table[first:last]
    runs = testbed.loaded.run(
        study.motion.time,
        outputs=OUTPUTS,
        measures=MEASURES,
        threads=threads,
        **driven_by(study.motion, dict(zip(study.names, table.T))),
    )
    columns = [runs[name, measure].tolist() for name in OUTPUTS for measure in MEASURES]
    rows = []
    for number, values, measured in zip(range(first, last), table.tolist(), zip(*columns)):
        if number - first in runs.errors:
            rows.append(failed(study, number, stopped(runs.errors[number - first])))
        else:
            done = {"run": number, "status": "done", "message": ""}
            rows.append({**done, **dict(zip(study.columns(), (*values, *measured)))})
    return rows


def failed(study: Study, number: int, message: str) -> dict[str, Any]:
    """The result of a run that could not be finished."""
    values = dict(zip(study.names, study.table[number].tolist()))
    return {**dict.fromkeys(study.columns()), "run": number, "status": "failed", "message": message, **values}


def _leave() -> None:
    if "testbed" in _bench:
        _bench.pop("testbed").close()
    _bench.pop("key", None)


def chunks(missing: Sequence[int], size: int) -> list[tuple[int, int]]:
    """Runs that are not done yet, as (first, last + 1) of at most `size` neighbours."""
    found: list[tuple[int, int]] = []
    for number in missing:
        if found and found[-1][1] == number and number - found[-1][0] < size:
            found[-1] = (found[-1][0], number + 1)
        else:
            found.append((number, number + 1))
    return found
