"""Results of a sweep: in memory; or on disk, a part for each finished chunk and one table in the end, so that an
interruption loses no finished chunk."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from prw.errors import UserError
from prw.files import replacing
from prw.sweeps.study import Study


def schema(study: Study) -> pa.Schema:
    """The columns of a study's table."""
    names = [("run", pa.int64()), ("status", pa.string()), ("message", pa.string())]
    return pa.schema(names + [(name, pa.float64()) for name in study.columns()], metadata={"study": study.key})


class Memory:
    """The results of a study that is not kept on disk."""

    def __init__(self, study: Study):
        self._schema, self._rows = schema(study), list[Mapping[str, Any]]()

    def done(self) -> set[int]:
        """Numbers of the runs that need not be made again: none."""
        return set()

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Keep the results of a chunk."""
        self._rows += rows

    def finish(self) -> pa.Table:
        """All results, sorted by run."""
        return pa.Table.from_pylist(self._rows, schema=self._schema).sort_by("run")


class Store:
    """The folder of one study."""

    def __init__(self, folder: Path, study: Study):
        """Open the folder for `study`; raises UserError where it holds another one or is unreadable."""
        self.folder, self._study = folder, study
        self._parts, self._about = folder / "parts", folder / "study.json"
        self.table = folder / "runs.parquet"
        self._schema = schema(study)
        if self._about.exists() or self.table.exists():
            if self._key() != study.key:
                raise UserError(f"{folder} holds another study; choose another, or remove it", argument="out")
        else:
            with replacing(self._about) as temporary:
                about = {"study": study.key, "runs": len(study.table), "parameters": study.names}
                temporary.write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")

    def _key(self) -> str:
        try:
            return str(json.loads(self._about.read_text(encoding="utf-8"))["study"])
        except (OSError, ValueError, KeyError, TypeError):
            return ""

    def done(self) -> set[int]:
        """Numbers of the runs that need not be made again."""
        if self.table.exists():
            return set(range(len(self._study.table)))
        found: set[int] = set()
        for part in self._whole():
            found.update(self._read(part).column("run").to_pylist())
        return found

    def add(self, rows: Sequence[Mapping[str, Any]]) -> None:
        """Keep the results of a chunk."""
        table = pa.Table.from_pylist([dict(row) for row in rows], schema=self._schema)
        with replacing(self._parts / f"{rows[0]['run']:09d}-{rows[-1]['run']:09d}.parquet") as temporary:
            pq.write_table(table, temporary)

    def finish(self) -> pa.Table:
        """Put all parts into one table, sorted by run."""
        if not self.table.exists():
            whole = pa.concat_tables([self._read(part) for part in self._whole()]).sort_by("run")
            with replacing(self.table) as temporary:
                pq.write_table(whole, temporary)
            shutil.rmtree(self._parts)
        return self._read(self.table)

    def _whole(self) -> list[Path]:
        """The parts that were written to their end: a process that is killed leaves others, with a dot before the
        name."""
        return sorted(self._parts.glob("[0-9]*.parquet"))

    def _read(self, part: Path) -> pa.Table:
        try:
            return pq.read_table(part, schema=self._schema)
        except (OSError, pa.ArrowException) as error:
            raise UserError(f"{part}: cannot be read ({error}); remove it and start again") from None
