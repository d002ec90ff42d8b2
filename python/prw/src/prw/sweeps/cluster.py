"""Runs of a sweep on a Dask cluster. A worker that dies costs nobody else's run."""

from __future__ import annotations

import atexit
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed
from functools import lru_cache
from pathlib import Path
from typing import Any

from prw.errors import UserError
from prw.sweeps.study import Chunk, Rows, Study, failed, run_chunk
from prw.testbed import Testbed

#: How long to wait for a cluster's scheduler, s.
PATIENCE = 15


def on_cluster(study: Study, chunks: Sequence[Chunk], address: str) -> Iterator[Rows]:
    """Results of the chunks as they come from the Dask cluster at `address`. What fails as a whole there (its worker
    died again and again) is recorded as failed, run by run."""
    client = _connect(address)
    try:
        remote = client.scatter(study, broadcast=True, hash=False)
        executor = client.get_executor(retries=2)
        futures = {executor.submit(_on_worker, remote, chunk): chunk for chunk in chunks}
        for future in as_completed(futures):
            error: BaseException | None = future.exception()
            if isinstance(error, ImportError):
                raise UserError(f"{address}: its workers lack a package ({error}); install prw on them")
            if error is None:
                yield future.result()
            else:
                yield [failed(study, number, f"lost on the cluster: {error}") for number in range(*futures[future])]
    finally:
        client.close()


def _on_worker(study: Study, chunk: Chunk) -> Rows:
    # Of a worker's own threads each makes a chunk.
    return run_chunk(study, _loaded(study.fmu), chunk, threads=1)


@lru_cache(maxsize=1)
def _loaded(fmu: bytes) -> Testbed:
    """The FMU, which a worker keeps from chunk to chunk."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.fmu"
        path.write_bytes(fmu)
        return Testbed(path)


# Removes the unpacked files, which an interpreter that ends does not wait for.
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
