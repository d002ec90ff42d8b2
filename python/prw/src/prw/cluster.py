"""Runs of a sweep on a Dask cluster. A worker that dies loses only its own runs."""

from __future__ import annotations

import atexit
import tempfile
from collections.abc import Generator, Mapping
from concurrent.futures import as_completed
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from prw.batch import Part, Request, run_part
from prw.errors import UserError
from prw.motion import Array
from prw.testbed import Testbed

#: Timeout of a connection to the scheduler, s.
PATIENCE = 15


def on_cluster(
    fmu: Path, request: Request, values: Mapping[str, Array], parts: Mapping[int, slice], address: str
) -> Generator[tuple[int, Part], None, None]:
    """Yield the index and the results of each part of the runs as soon as it is finished on the Dask cluster at `address`. A part that
    fails is tried twice more, and a part whose worker dies is tried again as often as Dask's settings allow; then its runs are recorded
    as failed. Raises UserError if the cluster does not respond, has no workers, or its workers lack a package."""
    client = _connect(address)
    try:
        shared = client.scatter((fmu.read_bytes(), request), broadcast=True, hash=False)
        executor = client.get_executor(retries=2)
        futures = {
            executor.submit(_on_worker, shared, {n: v[part] for n, v in values.items()}): index
            for index, part in parts.items()
        }
        for future in as_completed(list(futures)):
            index, error = futures.pop(future), future.exception()
            if isinstance(error, ImportError):
                raise UserError(f"{address}: its workers lack a package ({error}); install prw on them")
            yield (
                index,
                future.result() if error is None else _lost(request, parts[index], f"lost on the cluster: {error}"),
            )
    finally:
        client.close()


def _lost(request: Request, runs: slice, message: str) -> Part:
    count = runs.stop - runs.start
    kept = request.motion.time[:: request.every] if request.every else np.empty(0)
    names = request.outputs if request.every else ()
    return Part(
        {f"{name}_{which}": np.full(count, np.nan) for name in request.outputs for which in request.statistics},
        dict.fromkeys(range(count), message),
        {"time": kept, **{name: np.full((count, len(kept)), np.nan) for name in names}} if names else {},
    )


def _on_worker(shared: tuple[bytes, Request], values: Mapping[str, Array]) -> Part:
    fmu, request = shared
    # A worker runs one task per thread at a time, so each task uses one thread.
    return run_part(_loaded(fmu), request, values, threads=1)


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

    class Connection(Client):  # type: ignore[misc]
        def __del__(self) -> None:
            """Do nothing: if an address is malformed, closing waits for the client that has not started. Others are closed below."""

    try:
        client = Connection(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        reason = f"no Dask scheduler responds there ({error or 'timeout'})"
        raise UserError(reason, argument="scheduler", given=address) from None
    if not client.scheduler_info()["workers"]:
        client.close()
        reason = f"the cluster has no workers; start some with `dask worker {address}`"
        raise UserError(reason, argument="scheduler", given=address)
    return client
