"""Runs of a sweep on a Dask cluster. A worker that dies loses only its own runs."""

from __future__ import annotations

import atexit
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from functools import lru_cache
from pathlib import Path
from typing import Any

import pyarrow as pa

from prw.errors import UserError
from prw.sweeps.study import Chunk, Study, lost, run_chunk
from prw.testbed import Testbed

#: Timeout of a connection to the scheduler, s.
PATIENCE = 15


def on_cluster(study: Study, chunks: Sequence[Chunk], address: str) -> Iterator[tuple[Chunk, pa.Table]]:
    """Chunks with their results, as they come from the Dask cluster at `address`. The runs of a chunk whose worker died
    again and again are recorded as failed."""
    client = _connect(address)
    try:
        remote = client.scatter(study, broadcast=True, hash=False)
        executor = client.get_executor(retries=2)
        futures = {executor.submit(_on_worker, remote, chunk): chunk for chunk in chunks}
        for future in as_completed(futures):
            error: BaseException | None = future.exception()
            if isinstance(error, ImportError):
                raise UserError(f"{address}: its workers lack a package ({error}); install prw on them")
            chunk = futures[future]
            yield chunk, future.result() if error is None else lost(study, chunk, f"lost on the cluster: {error}")
    finally:
        client.close()


def _on_worker(study: Study, chunk: Chunk) -> pa.Table:
    # A worker makes as many chunks at a time as it has threads.
    return run_chunk(study, _loaded(study.fmu), chunk, threads=1)


@lru_cache(maxsize=1)
def _loaded(fmu: bytes) -> Testbed:
    """The FMU, which a worker loads once."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.fmu"
        path.write_bytes(fmu)
        return Testbed(path)


# Removes the unpacked files at exit.
atexit.register(_loaded.cache_clear)


def _connect(address: str) -> Any:
    from distributed import Client

    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = f"no Dask scheduler answers there ({error or 'timeout'})"
        raise UserError(reason, argument="scheduler", given=address) from None
    if not client.scheduler_info()["workers"]:
        client.close()
        reason = f"the cluster has no workers; start some with `dask worker {address}`"
        raise UserError(reason, argument="scheduler", given=address)
    return client
