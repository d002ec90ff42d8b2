"""Reads numbers from a CSV file. Every error names the file, the line and the column."""

from __future__ import annotations

import codecs
import csv
import math
import os
import re
from array import array
from collections.abc import Callable, Container, Sequence
from itertools import repeat
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np

from prw.errors import UserError
from prw.motion import Array
from prw.progress import Progress

DELIMITERS = (",", ";", "\t")
#: Rows between two progress reports.
REPORT_ROWS = 4096
#: Characters per block of plain rows.
BLOCK = 1 << 22

#: The columns to read, (name, index), of a header in the line with this number.
Choice = Callable[[Sequence[str], int], Sequence[tuple[str, int]]]


class _Layout(NamedTuple):
    """The file and its layout. width: cells of the header. columns, may_be_empty, increasing: as in `read_table`. size: bytes."""

    path: Path
    delimiter: str
    width: int
    columns: Sequence[tuple[str, int]]
    may_be_empty: Container[str]
    increasing: bool
    size: int


def read_table(
    path: Path,
    choose: Choice,
    may_be_empty: Container[str] = (),
    increasing: bool = False,
    skip: int = 0,
    encoding: str = "",
) -> Array:
    """Read the columns (rows, columns) that `choose` selects from the header, in the format that `prw.read` describes.

    An empty cell in a column of `may_be_empty` becomes NaN. increasing: whether the first column, the time, must
    increase. skip: lines above the header. encoding: of the file (default: UTF-8, or UTF-16 if the file begins with its mark).
    Raises UserError naming file, line and column.
    """
    try:
        chosen = encoding or _encoding(path)
        with open(path, encoding=chosen, newline="") as file:
            return _parse(path, file, choose, may_be_empty, increasing, skip)
    except UnicodeError:
        if encoding:
            raise UserError(f"{path}: not {encoding} text; give its encoding, or save it as UTF-8 CSV") from None
        raise UserError(
            f"{_where(path, _undecodable_line(path))}: not UTF-8 text; give its encoding, or save it as UTF-8 CSV"
        ) from None
    except LookupError:
        raise UserError(f"{encoding!r} is not known; try utf-16 or latin-1", argument="encoding") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror or error})") from None


def _encoding(path: Path) -> str:
    with open(path, "rb") as file:
        return "utf-16" if file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"


def _parse(
    path: Path, file: IO[str], choose: Choice, may_be_empty: Container[str], increasing: bool, skip: int
) -> Array:
    begin, first = _top(file, skip)
    if not first:
        raise UserError(f"{path}: the file is empty; a header and at least two rows are needed")
    delimiter = next((d for d in DELIMITERS if d in first), ",")
    table = _reader(file, delimiter)
    try:
        header = [name.strip() for name in _header(table, begin)]
        header[0] = header[0].lstrip("# ")
        columns = choose(header, table.line_num)
        size = os.fstat(file.fileno()).st_size
        layout = _Layout(path, delimiter, len(header), columns, may_be_empty, increasing, size)
        quick = _plain_rows(file, table.line_num, layout)
        if quick is not None:
            return quick
        table = _reader(file, delimiter)
        _header(table, begin)
        values = _rows(table, layout)
    except csv.Error as error:
        raise UserError(f"{_where(path, table.line_num)}: not a readable CSV row ({error})") from None
    if len(values) < 2:
        rows = "only one row below the header" if len(values) else "no rows below the header"
        raise UserError(f"{_where(path, table.line_num)}: {rows}; at least two are needed")
    return values


def _top(file: IO[str], skip: int) -> tuple[int, str]:
    """The number of lines above the header (`skip`, then blank lines or comments after `#`) and the header, "" if there is
    none. numpy also writes a `#` before the header: the header is then the last comment, directly above numbers."""
    for _ in range(skip):
        file.readline()
    count, comment, line = skip, "", file.readline()
    while line and (not line.strip() or line.lstrip().startswith("#")):
        count, comment, line = count + 1, line.strip() and line, file.readline()
    if comment and line.strip() and re.match(r"[-+.\d]", line.lstrip()):
        return count - 1, comment
    return count, line


def _reader(file: IO[str], delimiter: str) -> Any:
    file.seek(0)
    return csv.reader(file, delimiter=delimiter, skipinitialspace=True)


def _header(table: Any, begin: int) -> list[str]:
    """The first row below `begin` lines."""
    return next(row for row in table if row and table.line_num > begin)


def _plain_rows(file: IO[str], begin: int, layout: _Layout) -> Array | None:
    """The result of `_rows` for the lines below `begin`, in blocks; None if a line needs `_rows`."""
    path, delimiter, width, columns, may_be_empty, increasing, size = layout
    file.seek(0)
    for _ in range(begin):
        file.readline()
    parts, bytes_read = [], 0
    with Progress(f"reading {path}", size) as progress:
        while text := file.read(BLOCK) + file.readline():
            bytes_read += len(text)
            if "\r" in text:
                text = text.replace("\r\n", "\n")
            if delimiter == ";" and "," in text:
                text = text.replace(",", ".")
            if any(mark in text for mark in '"#\r'):
                return None
            while delimiter * 2 in text:
                text = text.replace(delimiter * 2, f"{delimiter}nan{delimiter}")
            if f"{delimiter}\n" in text:
                text = text.replace(f"{delimiter}\n", f"{delimiter}nan\n")
            lines = list(filter(None, text.split("\n")))
            if not {width - 1}.issuperset(map(str.count, lines, repeat(delimiter))):
                return None
            try:
                used = [index for _, index in columns]
                parts.append(np.loadtxt(lines, delimiter=delimiter, usecols=used, comments=None, ndmin=2))
            except ValueError:
                return None
            progress(bytes_read)
    values = np.concatenate(parts) if parts else np.empty((0, len(columns)))
    empty = [name in may_be_empty for name, _ in columns]
    if len(values) < 2 or np.isinf(values).any() or np.isnan(values[:, np.logical_not(empty)]).any():
        return None
    return None if increasing and not (np.diff(values[:, 0]) > 0).all() else values


def _rows(table: Any, layout: _Layout) -> Array:
    """All rows below the header, (rows, columns), checked cell by cell."""
    path, delimiter, width, columns, may_be_empty, increasing, size = layout
    cells, previous, bytes_read = array("d"), -math.inf, 0
    with Progress(f"reading {path}", size) as progress:
        for count, row in enumerate(table):
            # Some tools end each row, but not the header, with a separator.
            if len(row) != width and not (len(row) == width + 1 and not row[-1].strip()):
                if not row or row[0].startswith("#"):
                    continue
                number = "1 cell" if len(row) == 1 else f"{len(row)} cells"
                raise UserError(f"{_where(path, table.line_num)}: {number}, but the header has {width}")
            for name, index in columns:
                text = row[index]
                try:
                    value = float(text.replace(",", ".") if delimiter == ";" else text)
                except ValueError:
                    value = None
                # float() would take 1_000 for a thousand
                if name in may_be_empty and text.strip().lower() in ("", "nan"):
                    value = math.nan
                elif value is None or "_" in text:
                    shown = f"{text.strip()[:40]!r} is not a number" if text.strip() else "empty cell"
                    raise UserError(f"{_where(path, table.line_num)}, column {name}: {shown}")
                elif not math.isfinite(value):
                    raise UserError(f"{_where(path, table.line_num)}, column {name}: {text.strip()} is not finite")
                cells.append(value)
            if increasing:
                time = cells[-len(columns)]
                if time <= previous:
                    complaint = "is the time of the row before again" if time == previous else "runs backwards"
                    raise UserError(
                        f"{_where(path, table.line_num)}, column time: {row[columns[0][1]].strip()} {complaint}"
                        f" (after {previous!r}); time must increase from row to row"
                    )
                previous = time
            if count % REPORT_ROWS == 0:
                progress(bytes_read)
            bytes_read += sum(map(len, row)) + width
    return np.array(cells).reshape(-1, len(columns))


def _undecodable_line(path: Path) -> int:
    with open(path, "rb") as file:
        for number, line in enumerate(file, start=1):
            try:
                line.decode("utf-8-sig" if number == 1 else "utf-8")
            except UnicodeDecodeError:
                return number
    return 1


def _where(path: Path, line: int) -> str:
    return f"{path}, row {line}"
