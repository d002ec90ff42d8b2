"""Runs of a sweep on a Dask cluster. A worker that dies loses only its own runs."""

from __future__ import annotations

import atexit
import tempfile
from collections.abc import Callable, Mapping
from concurrent.futures import as_completed
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from prw.batch import MEASURES, Statistics, statistics
from prw.errors import UserError
from prw.motion import Array, Motion
from prw.testbed import OUTPUTS, Testbed

#: Timeout of a connection to the scheduler, s.
PATIENCE = 15
#: Number of tasks, unless they would then have fewer than SHORTEST or more than LONGEST runs.
TASKS = 16
#: Minimum and maximum number of runs in a task.
SHORTEST, LONGEST = 16, 256


def on_cluster(
    fmu: Path,
    motion: Motion,
    fixed: Mapping[str, Any],
    values: Mapping[str, Array],
    address: str,
    progress: Callable[[int], None],
) -> Statistics:
    """The statistics of runs on the Dask cluster at `address`. A task that fails is tried twice more, and a task whose worker
    dies is tried again as often as Dask's settings allow; then its runs are recorded as failed. Raises UserError if the
    cluster does not respond, has no workers, or its workers lack a package."""
    total = len(next(iter(values.values())))
    measured = {f"{name}_{measure}": np.full(total, np.nan) for name in OUTPUTS for measure in MEASURES}
    errors: dict[int, str] = {}
    done = 0
    client = _connect(address)
    try:
        shared = client.scatter((fmu.read_bytes(), motion, dict(fixed)), broadcast=True, hash=False)
        executor = client.get_executor(retries=2)
        size = min(max(-(-total // TASKS), SHORTEST), LONGEST)
        parts = [slice(first, min(first + size, total)) for first in range(0, total, size)]
        futures = {executor.submit(_on_worker, shared, {n: v[part] for n, v in values.items()}): part for part in parts}
        for future in as_completed(futures):
            part, error = futures[future], future.exception()
            if isinstance(error, ImportError):
                raise UserError(f"{address}: its workers lack a package ({error}); install prw on them")
            if error is None:
                found, failed = future.result()
                errors |= {part.start + run: message for run, message in failed.items()}
                for name, column in found.items():
                    measured[name][part] = column
            else:
                errors |= dict.fromkeys(range(part.start, part.stop), f"lost on the cluster: {error}")
            done += part.stop - part.start
            progress(done)
    finally:
        client.close()
    return measured, errors


def _on_worker(shared: tuple[bytes, Motion, Mapping[str, Any]], values: Mapping[str, Array]) -> Statistics:
    fmu, motion, fixed = shared
    # A worker runs one task per thread at a time, so each task uses one thread.
    return statistics(_loaded(fmu), motion, {**fixed, **values}, threads=1)


@lru_cache(maxsize=1)
def _loaded(fmu: bytes) -> Testbed:
    """The FMU, which a worker loads once."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "study.fmu"
        path.write_bytes(fmu)
        return Testbed(path)


# Removes the unpacked files at exit.
atexit.register(_loaded.cache_clear)


def _connect(address: str) -> Any:
    from distributed import Client

    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = f"no Dask scheduler responds there ({error or 'timeout'})"
        raise UserError(reason, argument="scheduler", given=address) from None
    if not client.scheduler_info()["workers"]:
        client.close()
        reason = f"the cluster has no workers; start some with `dask worker {address}`"
        raise UserError(reason, argument="scheduler", given=address)
    return client
