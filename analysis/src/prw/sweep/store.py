"""Results on disk: a part for each finished chunk, one table in the end. An interruption loses no finished chunk."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any, Dict, List, Mapping, Set

import pyarrow as pa
import pyarrow.parquet as pq

from prw.errors import UserError
from prw.files import replacing
from prw.sweep.study import Study


class Store:
    """The folder of one study."""

    def __init__(self, folder: Path, study: Study):
        """Open the folder for `study`; raises UserError where it holds another one or is unreadable."""
        self.folder, self._study = folder, study
        self._parts, self._about = folder / "parts", folder / "study.json"
        self.table = folder / "runs.parquet"
        self._schema = pa.schema(
            [("run", pa.int64()), ("status", pa.string()), ("message", pa.string())]
            + [(name, pa.float64()) for name in study.columns()],
            metadata={"study": study.key},
        )
        if self._about.exists() or self.table.exists():
            if self._key() != study.key:
                raise UserError(f"{folder}: holds another study; choose another --out, or remove it")
        else:
            with replacing(self._about) as temporary:
                about = {"study": study.key, "runs": len(study.table), "parameters": study.names}
                temporary.write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")

    def _key(self) -> str:
        try:
            return json.loads(self._about.read_text(encoding="utf-8"))["study"]
        except (OSError, ValueError, KeyError, TypeError):
            return ""

    def done(self) -> Set[int]:
        """Numbers of the runs that need not be made again."""
        if self.table.exists():
            return set(range(len(self._study.table)))
        found: Set[int] = set()
        for part in self._whole():
            found.update(self._read(part).column("run").to_pylist())
        return found

    def add(self, rows: List[Mapping[str, Any]]) -> None:
        """Keep the results of a chunk."""
        table = pa.Table.from_pylist([dict(row) for row in rows], schema=self._schema)
        with replacing(self._parts / f"{rows[0]['run']:09d}-{rows[-1]['run']:09d}.parquet") as temporary:
            pq.write_table(table, temporary)

    def finish(self) -> Dict[str, int]:
        """Put all parts into one table, sorted by run. Returns the number of runs by status."""
        if not self.table.exists():
            whole = pa.concat_tables([self._read(part) for part in self._whole()]).sort_by("run")
            with replacing(self.table) as temporary:
                pq.write_table(whole, temporary)
            shutil.rmtree(self._parts)
        counts = pq.read_table(self.table, columns=["status"]).column("status").value_counts().to_pylist()
        return {entry["values"]: entry["counts"] for entry in counts}

    def first_failure(self) -> str:
        """The message of the first run that failed."""
        table = pq.read_table(self.table, columns=["run", "status", "message"]).to_pylist()
        return next((f"run {row['run']}: {row['message']}" for row in table if row["status"] == "failed"), "")

    def _whole(self) -> List[Path]:
        """The parts that were written to their end: a process that is killed leaves others, with a dot before the name."""
        return sorted(self._parts.glob("[0-9]*.parquet"))

    def _read(self, part: Path) -> pa.Table:
        try:
            return pq.read_table(part, schema=self._schema)
        except (OSError, pa.ArrowException) as error:
            raise UserError(f"{part}: cannot be read ({error}); remove it and start again") from None
