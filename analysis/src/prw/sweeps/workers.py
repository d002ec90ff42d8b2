"""Where runs are made: processes of this machine, or a Dask cluster. A worker that dies costs nobody else's run."""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
import threading
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from prw.errors import UserError
from prw.sweeps.study import Study, failed, prepare, run_chunk, run_rows
from prw.testbed import Testbed

#: How long to wait for a cluster's scheduler, s.
PATIENCE = 15
Chunk = tuple[int, int]
Rows = list[dict[str, Any]]


def in_this_process(study: Study, chunks: Sequence[Chunk]) -> Iterator[Rows]:
    """Results of the chunks in order, on all processors. An FMU that crashes takes the process with it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "study.fmu"
        path.write_bytes(study.fmu)
        with Testbed(path) as testbed:
            for first, last in chunks:
                yield run_rows(study, testbed, first, last, threads=None)


def on_this_machine(study: Study, chunks: Sequence[Chunk], workers: int) -> Iterator[Rows]:
    """Results of the chunks as they come. If a process dies, what was under way is made again, run by run; a run that
    kills its process once more is recorded as failed."""
    left = list(chunks)
    with _pool(study, workers) as pool:
        futures = {pool.submit(run_chunk, None, *chunk): chunk for chunk in left}
        try:
            for future in as_completed(futures):
                yield future.result()
                left.remove(futures[future])
        except BrokenProcessPool:
            pass
        except BaseException:
            # Interrupted: do not start what has not begun.
            for future in futures:
                future.cancel()
            raise
    for first, last in left:
        yield [_carefully(study, number) for number in range(first, last)]


def _carefully(study: Study, number: int) -> dict[str, Any]:
    """One run in a process that has begun with nothing else."""
    pool = _careful.get("pool")
    if pool is None:
        pool = _careful["pool"] = _executor(study, 1)
    try:
        return pool.submit(run_chunk, None, number, number + 1).result()[0]
    except BrokenProcessPool:
        pool.shutdown()
        _careful.clear()
        return failed(study, number, "the process died in this run")


_careful: dict[str, Executor] = {}


def _executor(study: Study, workers: int) -> ProcessPoolExecutor:
    # Not forked: the parent has threads (Arrow's) that a fork would leave in pieces.
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(study,))


def _begin(study: Study) -> None:
    """What a process of this machine does first. It leaves Ctrl-C to its parent, and goes when the parent is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    assert parent is not None

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
    prepare(study)


@contextmanager
def _pool(study: Study, workers: int) -> Iterator[ProcessPoolExecutor]:
    try:
        with _executor(study, workers) as pool:
            yield pool
    finally:
        if "pool" in _careful:
            _careful.pop("pool").shutdown()


def on_cluster(study: Study, chunks: Sequence[Chunk], address: str) -> Iterator[Rows]:
    """Results of the chunks as they come from the Dask cluster at `address`. What fails as a whole there (its worker
    died again and again) is recorded as failed, run by run."""
    client = _connect(address)
    try:
        remote = client.scatter(study, broadcast=True, hash=False)
        executor = client.get_executor(retries=2)
        futures = {executor.submit(run_chunk, remote, *chunk): chunk for chunk in chunks}
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


def _connect(address: str) -> Any:
    from distributed import Client

    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise UserError(f"--scheduler {address}: no Dask scheduler answers there ({error or 'timeout'})") from None
    if not client.scheduler_info()["workers"]:
        client.close()
        raise UserError(f"--scheduler {address}: the cluster has no workers; start some with `dask worker {address}`")
    return client
