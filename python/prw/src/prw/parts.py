"""The finished parts of a sweep, in memory or on disk, from which an interrupted sweep continues."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from prw.batch import Part
from prw.errors import UserError
from prw.files import check_regular, locked, replacing
from prw.motion import Array

if TYPE_CHECKING:
    import pyarrow

#: Key of the record in the metadata of the files.
KEY = b"prw.sweep"
#: Number of samples after which a part ends; about a third of a second. A part has at most one of SHARES of all runs, so that the workers
#: of a cluster share them, but at least SMALLEST if these are not too long.
SAMPLES, SHARES, SMALLEST = 10_000_000, 16, 16
TABLE, PARTS, TRAJECTORIES = "runs.parquet", "parts", "trajectories"
#: Key of the checksum in the metadata, with which a file is compared before a sweep continues from it.
CHECKSUM = b"prw.sha256"
#: Entries that are needed to repeat a sweep, and their types.
ENTRIES = {
    "parameters": dict,
    "outputs": list,
    "statistics": list,
    "varied": list,
    "values": str,
    "motion": dict,
    "fmu": dict,
    "versions": dict,
}


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
    """The record that a file of a sweep contains. Raises UserError if there is none, or if it lacks an entry."""
    import pyarrow as pa
    from pyarrow import parquet

    try:
        check_regular(path)
        metadata = parquet.read_schema(path).metadata
    except (OSError, pa.ArrowException) as error:
        raise Unreadable(f"{path}: cannot be read ({error})") from None
    try:
        record = json.loads((metadata or {})[KEY])
        complete = all(isinstance(record[name], kind) for name, kind in ENTRIES.items())
    except (KeyError, TypeError, ValueError, RecursionError):
        complete = False
    if not complete:
        raise UserError(f"{path}: has no record of its sweep, because something else or an older prw wrote it")
    return dict(record)


class Unreadable(UserError):
    """A file is not a Parquet file, or damaged."""


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
        self._kinds = (PARTS, TRAJECTORIES) if record["trajectories"] else (PARTS,)
        #: Whether the table of all runs is on disk, and the files of finished parts that are.
        self._whole, self._sound = False, set[Path]()
        #: A message for each damaged file, whose runs will be repeated.
        self.notes: list[str] = []

    @property
    def are_on_disk(self) -> bool:
        """Whether finished parts outlast the process."""
        return self._directory is not None

    @contextlib.contextmanager
    def opened(self) -> Iterator[None]:
        """Lock the directory and check every file in it. Raises UserError if the directory cannot be written, if another process uses
        it, or if it contains another sweep. Damaged files of this sweep count as missing, and `notes` has a message for each."""
        if self._directory is None:
            yield
            return
        with locked(self._directory):
            self._whole = self._is_sound(self._directory / TABLE, slice(0, self.runs))
            for kind in (PARTS, TRAJECTORIES):
                own = {self._path(kind, index): part for index, part in enumerate(self.slices)}
                # Temporary files of killed processes begin with a dot.
                for path in sorted((self._directory / kind).glob("[!.]*")):
                    if path not in own:
                        raise UserError(f"{path}: is not a part of this sweep; {self._remedy}")
                self._sound |= {path for path, part in own.items() if self._is_sound(path, part)}
            yield

    @property
    def _remedy(self) -> str:
        return f"write into another directory, or remove {self._directory}"

    def _is_sound(self, path: Path, runs: slice) -> bool:
        """Whether the file exists and contains these runs of this sweep as they were written. Raises UserError if it is not from this
        sweep."""
        if not os.path.lexists(path):
            return False
        try:
            record = record_in(path)
        except UserError as error:
            # Only its path shows from which sweep a file is that cannot be read. A table may be from anywhere.
            if not isinstance(error, Unreadable) or path.name == TABLE:
                raise UserError(f"{error}; {self._remedy}") from None
            damage = str(error)
        else:
            if difference := _difference(record, json.loads(self._text)):
                raise UserError(f"{path} is from a sweep with other arguments ({difference}); {self._remedy}")
            damage = _damage(path, runs)
        if damage:
            self.notes.append(f"{damage}, so runs {runs.start} to {runs.stop - 1} are repeated")
        return not damage

    def missing(self) -> dict[int, slice]:
        """The runs of each unfinished part, by its index."""
        return {k: part for k, part in enumerate(self.slices) if not self._is_finished(k)}

    def _is_finished(self, index: int) -> bool:
        if self._directory is None:
            return index in self._kept
        needed = {self._path(kind, index) for kind in self._kinds if kind != PARTS or not self._whole}
        return needed <= self._sound

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
        if self._directory is None:
            self._kept[index] = pa.table(columns)
            return
        if found.trajectories:
            time = found.trajectories["time"]
            outputs = {name: values.ravel() for name, values in found.trajectories.items() if name != "time"}
            kept = {"run": np.repeat(runs, len(time)), "time": np.tile(time, len(runs)), **outputs}
            self._write(self._path(TRAJECTORIES, index), pa.table(kept))
        self._write(self._path(PARTS, index), pa.table(columns))

    def table(self) -> pyarrow.Table:
        """A row for each run of the finished parts."""
        import pyarrow as pa

        if self._directory is None:
            tables = [self._kept[index] for index in sorted(self._kept)]
        elif self._whole:
            tables = [_read(self._directory / TABLE)]
        else:
            tables = [_read(self._path(PARTS, index)) for index in range(len(self.slices)) if self._is_finished(index)]
        if not tables:
            return None
        # One chunk, so that the bytes of the file do not depend on the parts.
        return pa.concat_tables(tables).combine_chunks().replace_schema_metadata({KEY: self._text})

    def finish(self) -> pyarrow.Table:
        """Write the table of all runs, remove their parts, and return it."""
        table = self.table()
        if self._directory is not None:
            if not self._whole:
                self._write(self._directory / TABLE, table)
            shutil.rmtree(self._directory / PARTS, ignore_errors=True)
        return table

    def _path(self, kind: str, index: int) -> Path:
        return (self._directory or Path()) / kind / f"part-{index:05}.parquet"

    def _write(self, path: Path, table: pyarrow.Table) -> None:
        from pyarrow import parquet

        metadata = {KEY: self._text, CHECKSUM: _checksum(table)}
        with replacing(path) as temporary:
            parquet.write_table(table.replace_schema_metadata(metadata), temporary)
        self._sound.add(path)


def _read(path: Path) -> pyarrow.Table:
    from pyarrow import parquet

    # Directory names are not columns.
    return parquet.read_table(path, partitioning=None)


def _damage(path: Path, runs: slice) -> str:
    """Describes how the rows of a file differ from the rows that were written; empty if they do not."""
    import pyarrow as pa

    try:
        table = _read(path)
    except (OSError, pa.ArrowException) as error:
        return f"{path}: cannot be read ({error})"
    if (table.schema.metadata or {}).get(CHECKSUM) != _checksum(table):
        return f"{path}: was changed after it was written"
    # Trajectories have several rows for each run.
    if not np.array_equal(np.unique(table["run"].to_numpy()), np.arange(runs.start, runs.stop)):
        return f"{path}: contains other runs"
    return ""


def _checksum(table: pyarrow.Table) -> bytes:
    """SHA-256 of the names, types and values of a table."""
    found = hashlib.sha256()
    for name, column in zip(table.column_names, table.columns):
        found.update(json.dumps([name, str(column.type), len(column)]).encode())
        if column.type in ("int64", "double"):
            found.update(column.is_null().to_numpy().tobytes() + column.fill_null(0).to_numpy().tobytes())
        else:
            found.update(json.dumps(column.to_pylist(), default=str).encode())
    return found.hexdigest().encode()


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
