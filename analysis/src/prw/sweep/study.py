"""What a sweep consists of, and one run of it. Everything here is sent to the workers."""

from __future__ import annotations

import atexit
import hashlib
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Dict, List, Optional, Sequence, Tuple

import fmu_run
import numpy as np

from prw.motion import Motion
from prw.testbed import OUTPUTS, Testbed, driven_by, stopped

#: What is kept of each output's course.
MEASURES: Tuple[fmu_run.Measure, ...] = ("peak", "rms", "end")


@dataclass(frozen=True)
class Study:
    """fmu: the FMU file's content. motion: what the motors do. names: parameters that vary; table: their values in SI,
    (runs, len(names)). key: a hash of all this."""

    fmu: bytes
    motion: Motion
    names: Tuple[str, ...]
    table: np.ndarray
    key: str = field(init=False)

    def __post_init__(self) -> None:
        digest = hashlib.sha256(self.fmu)
        arrays = [self.motion.time, self.motion.theta, self.motion.omega, self.table]
        for array in filter(lambda a: a is not None, arrays):
            digest.update(np.ascontiguousarray(array).tobytes() + b"|")
        digest.update(",".join((*self.names, *MEASURES, *OUTPUTS)).encode())
        object.__setattr__(self, "key", digest.hexdigest()[:16])

    def columns(self) -> List[str]:
        """Names of a result's columns after `run`, `status` and `message`."""
        return [*self.names, *(f"{output}_{measure}" for output in OUTPUTS for measure in MEASURES)]


#: The study and the FMU of this worker process, kept from chunk to chunk.
_bench: Dict[str, Any] = {}


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


def run_chunk(study: Optional[Study], first: int, last: int) -> List[Dict[str, Any]]:
    """Results of runs first ... last - 1. study: or None where prepare() has been called in this process."""
    if study is not None:
        prepare(study)
    study = _bench["study"]
    table = study.table[first:last]
    # The processes are the parallel part: one that dies costs the others nothing.
    runs = _bench["testbed"].loaded.run(
        study.motion.time,
        outputs=OUTPUTS,
        measures=MEASURES,
        threads=1,
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


def failed(study: Study, number: int, message: str) -> Dict[str, Any]:
    """The result of a run that could not be finished."""
    values = dict(zip(study.names, study.table[number].tolist()))
    return {**dict.fromkeys(study.columns()), "run": number, "status": "failed", "message": message, **values}


def _leave() -> None:
    if "testbed" in _bench:
        _bench.pop("testbed").close()
    _bench.pop("key", None)


def chunks(missing: Sequence[int], size: int) -> List[Tuple[int, int]]:
    """Runs that are not done yet, as (first, last + 1) of at most `size` neighbours."""
    found: List[Tuple[int, int]] = []
    for number in missing:
        if found and found[-1][1] == number and number - found[-1][0] < size:
            found[-1] = (found[-1][0], number + 1)
        else:
            found.append((number, number + 1))
    return found
