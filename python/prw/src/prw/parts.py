"""The finished parts of a sweep, in memory or on disk, from which an interrupted sweep continues."""

from __future__ import annotations

import contextlib
import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from prw.batch import Part
from prw.errors import UserError
from prw.files import locked, replacing
from prw.motion import Array

if TYPE_CHECKING:
    import pyarrow

#: Key of the record in the metadata of the files.
KEY = b"prw.sweep"
#: Number of samples after which a part ends; about a third of a second. A part has at most one of SHARES of all runs, so that the workers
#: of a cluster share them, but at least SMALLEST if these are not too long.
SAMPLES, SHARES, SMALLEST = 10_000_000, 16, 16
TABLE, PARTS, TRAJECTORIES = "runs.parquet", "parts", "trajectories"


def part_size(runs: int, samples: int) -> int:
    """Number of runs in a part. samples: number of samples of a run that take time or memory."""
    return max(1, min(SAMPLES // samples, max(-(-runs // SHARES), SMALLEST)))


def digest(*arrays: Array | None) -> str:
    """SHA-256 of the shapes and values of arrays."""
    found = hashlib.sha256()
    for array in arrays:
        given = np.ascontiguousarray(np.empty(0) if array is None else array, dtype="<f8")
        found.update(repr(given.shape).encode() + given.tobytes())
    return found.hexdigest()


def versions() -> dict[str, str]:
    """The versions of the packages on which the values in a sweep depend."""
    return {name: version(name) for name in ("prw", "fmu-run", "numpy", "scipy")}


def record_in(path: Path) -> dict[str, Any]:
    """The record that a file of a sweep contains. Raises UserError if there is none."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        return dict(json.loads((parquet.read_schema(path).metadata or {})[KEY]))
    except (OSError, pa.ArrowException) as error:
        raise UserError(f"{path}: cannot be read ({error})") from None
    except KeyError:
        raise UserError(
            f"{path}: has no record of its sweep, because something else or an older prw wrote it"
        ) from None


class Parts:
    """The finished parts of a sweep.

    record: the arguments, versions and so on of the sweep, which are in the metadata of the files. values: (runs,) by parameter. size:
    number of runs in a part. directory: on disk; None keeps the parts in memory.
    """

    def __init__(self, record: Mapping[str, Any], values: Mapping[str, Array], size: int, directory: Path | None):
        self._values, self._directory, self._kept = values, directory, dict[int, "pyarrow.Table"]()
        # Converted, so that it is equal to a record that was read: tuples become lists.
        self._text = json.dumps(record, default=lambda value: np.asarray(value).tolist())
        self.runs = len(next(iter(values.values())))
        #: slice: the runs of each part.
        self.slices = [slice(first, min(first + size, self.runs)) for first in range(0, self.runs, size)]

    @property
    def are_on_disk(self) -> bool:
        """Whether finished parts outlast the process."""
        return self._directory is not None

    @contextlib.contextmanager
    def opened(self) -> Iterator[None]:
        """Lock the directory. Raises UserError if it cannot be written, if another process uses it, or if it contains another sweep."""
        if self._directory is None:
            yield
            return
        with locked(self._directory):
            for kind in (TABLE, f"{PARTS}/*.parquet", f"{TRAJECTORIES}/*.parquet"):
                for path in sorted(self._directory.glob(kind))[:1]:
                    self._check(path)
            yield

    def _check(self, path: Path) -> None:
        remedy = f"write into another directory, or remove {self._directory}"
        try:
            other = record_in(path)
        except UserError as error:
            raise UserError(f"{error}; {remedy}") from None
        if difference := _difference(other, json.loads(self._text)):
            raise UserError(f"{path} is from a sweep with other arguments ({difference}); {remedy}")

    def missing(self) -> dict[int, slice]:
        """The runs of each unfinished part, by its index."""
        if self._directory is not None and (self._directory / TABLE).is_file():
            return {}
        return {
            k: part for k, part in enumerate(self.slices) if k not in self._kept and not self._path(PARTS, k).is_file()
        }

    def keep(self, index: int, found: Part) -> None:
        """Add a finished part."""
        import pyarrow as pa

        runs, part = np.arange(self.runs)[self.slices[index]], self.slices[index]
        failed = np.isin(np.arange(len(runs)), list(found.errors))
        columns = {
            "run": pa.array(runs, pa.int64()),
            "status": np.where(failed, "failed", "done").tolist(),
            "message": [found.errors.get(k, "") for k in range(len(runs))],
            **{name: column[part] for name, column in self._values.items()},
            **{name: pa.array(column, mask=failed) for name, column in found.measured.items()},
        }
        table = self._with_record(pa.table(columns))
        if self._directory is None:
            self._kept[index] = table
            return
        if found.trajectories:
            time = found.trajectories["time"]
            outputs = {name: values.ravel() for name, values in found.trajectories.items() if name != "time"}
            columns = {"run": np.repeat(runs, len(time)), "time": np.tile(time, len(runs)), **outputs}
            # First, because a part without trajectories would count as finished.
            _write(self._path(TRAJECTORIES, index), self._with_record(pa.table(columns)))
        _write(self._path(PARTS, index), table)

    def table(self) -> pyarrow.Table:
        """A row for each run of the finished parts."""
        import pyarrow as pa
        from pyarrow import parquet

        if self._directory is None:
            tables = [self._kept[index] for index in sorted(self._kept)]
        elif (path := self._directory / TABLE).is_file():
            return parquet.read_table(path)
        else:
            paths = (self._path(PARTS, index) for index in range(len(self.slices)))
            tables = [parquet.read_table(path, partitioning=None) for path in paths if path.is_file()]
        # One chunk, so that the bytes of the file do not depend on the parts.
        return pa.concat_tables(tables).combine_chunks() if tables else None

    def finish(self) -> pyarrow.Table:
        """Write the table of all runs, remove their parts, and return it."""
        table = self.table()
        if self._directory is not None:
            if not (path := self._directory / TABLE).is_file():
                _write(path, table)
            shutil.rmtree(self._directory / PARTS, ignore_errors=True)
        return table

    def _path(self, kind: str, index: int) -> Path:
        return (self._directory or Path()) / kind / f"part-{index:05}.parquet"

    def _with_record(self, table: pyarrow.Table) -> pyarrow.Table:
        return table.replace_schema_metadata({KEY: self._text})


def finished_runs(directory: Path) -> int:
    """Number of runs in the finished parts of a sweep in the directory."""
    from pyarrow import parquet

    paths = [*directory.glob(TABLE), *directory.glob(f"{PARTS}/*.parquet")]
    return sum(parquet.read_metadata(path).num_rows for path in paths)


def _write(path: Path, table: pyarrow.Table) -> None:
    from pyarrow import parquet

    with replacing(path) as temporary:
        parquet.write_table(table, temporary)


def _difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Describes the first difference between two records; empty if they are equal."""
    for key in {**before, **now}:
        one, other = before.get(key), now.get(key)
        if isinstance(one, dict) and isinstance(other, dict):
            if found := _difference(one, other):
                return f"{key}: {found}"
        elif one != other:
            return f"{key} was {_brief(one)} and is {_brief(other)}"
    return ""


def _brief(value: Any) -> str:
    text = "absent" if value is None else json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
