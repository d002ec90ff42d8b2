"""Results of a sweep: in memory and, if it has a directory, a file for each finished chunk and one table at the end."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from prw.errors import UserError
from prw.files import replacing
from prw.sweeps.study import Chunk, Study


class Store:
    """The results of one study. missing: chunks that are still to be made."""

    def __init__(self, folder: Path | None, study: Study):
        """Read the results in `folder`. Raises UserError if the directory holds another study or is unreadable."""
        self._done: dict[Chunk, pa.Table] = {}
        self._folder, self.missing = folder, study.chunks()
        if folder is None:
            return
        about, self._whole = folder / "study.json", folder / "runs.parquet"
        if not about.exists() and not self._whole.exists():
            with replacing(about) as temporary:
                content = {"study": study.key, "runs": len(study.table), "parameters": study.names}
                temporary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
        elif _key(about) != study.key:
            raise UserError(f"{folder} holds another study; choose another, or remove it", argument="out")
        if self._whole.exists():
            self._done, self.missing = {(0, len(study.table)): _read(self._whole)}, []
        else:
            self._done = {chunk: _read(self._part(chunk)) for chunk in self.missing if self._part(chunk).exists()}
            self.missing = [chunk for chunk in self.missing if chunk not in self._done]

    def add(self, chunk: Chunk, results: pa.Table) -> None:
        """Keep the results of a chunk."""
        self._done[chunk] = results
        if self._folder is not None:
            with replacing(self._part(chunk)) as temporary:
                pq.write_table(results, temporary)

    def finish(self) -> pa.Table:
        """All results, sorted by run; written as one table that replaces the chunks."""
        whole = pa.concat_tables(self._done.values()).sort_by("run")
        if self._folder is not None and not self._whole.exists():
            with replacing(self._whole) as temporary:
                pq.write_table(whole, temporary)
            shutil.rmtree(self._folder / "parts")
        return whole

    def _part(self, chunk: Chunk) -> Path:
        assert self._folder is not None
        return self._folder / "parts" / f"{chunk[0]:09d}-{chunk[1] - 1:09d}.parquet"


def _key(about: Path) -> str:
    try:
        return str(json.loads(about.read_text(encoding="utf-8"))["study"])
    except (OSError, ValueError, KeyError, TypeError):
        return ""


def _read(path: Path) -> pa.Table:
    try:
        return pq.read_table(path)
    except (OSError, pa.ArrowException) as error:
        raise UserError(f"{path}: cannot be read ({error}); remove it and start again") from None
