"""Reads numbers from a CSV file. Errors name the file and, where possible, the line and the column."""

from __future__ import annotations

import codecs
import csv
import math
import os
import re
from array import array
from collections.abc import Callable, Container, Iterator, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np

from prw.errors import UserError
from prw.files import check_regular
from prw.motion import Array
from prw.progress import Progress

DELIMITERS = (",", ";", "\t")
#: Characters before decimals, of which a file has one.
_MARKS = frozenset(".,")
#: Rows between two progress reports.
REPORT_ROWS = 4096
#: Maximum number of characters of a line.
LONGEST_LINE = 1 << 20
REMEDY = (
    "save it as UTF-8 CSV, or name its encoding, such as latin-1 or utf-16-le, with --encoding (in Python "
    "prw.read(path, encoding=...))"
)
NO_TEXT = f"this is not a text file, or it is UTF-16 without its byte order mark; {REMEDY}"

#: Selects the columns to read, (name, index) each, from the header and the number of its line.
Choice = Callable[[Sequence[str], int], Sequence[tuple[str, int]]]


def read_table(
    path: Path,
    choose: Choice,
    may_be_empty: Container[str] = (),
    increasing: bool = False,
    skip: int = 0,
    encoding: str = "",
    least: int = 2,
) -> Array:
    """Read the columns (rows, columns) that `choose` selects from the header, in the format that `prw.read` describes.

    An empty cell in a column of `may_be_empty` becomes NaN. increasing: whether the first column, the time, must
    increase. skip: lines above the header. encoding: of the file (default: UTF-8, or UTF-16 if the file begins with its byte order mark).
    least: number of rows, 1 or 2.
    Raises UserError naming the file and, where possible, the line and the column.
    """
    try:
        check_regular(path)
        chosen = encoding or _encoding(path)
        with open(path, encoding=chosen, newline="") as file:
            return _parse(path, file, choose, may_be_empty, increasing, skip, least)
    except UnicodeError:
        if not encoding and _is_binary(path):
            raise UserError(f"{path}: {NO_TEXT}") from None
        where = path if encoding else _where(path, _undecodable_line(path))
        raise UserError(f"{where}: not {encoding or 'UTF-8'} text; {REMEDY}") from None
    except LookupError:
        raise UserError(f"{encoding!r} is not known; try utf-16 or latin-1", argument="encoding") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({error.strerror or error})") from None


def _encoding(path: Path) -> str:
    with open(path, "rb") as file:
        return "utf-16" if file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"


def _parse(
    path: Path, file: IO[str], choose: Choice, may_be_empty: Container[str], increasing: bool, skip: int, least: int
) -> Array:
    needed = "at least two rows are needed" if least > 1 else "at least one row is needed"
    begin, first = _top(file, skip)
    # Excel reads the separator from such a line above the header.
    separator = re.fullmatch(r'"?sep=(.)"?\s*', first, re.IGNORECASE)
    if separator:
        more, first = _top(file, 0)
        begin += 1 + more
    if not first:
        raise UserError(f"{path}: the file is empty; a header and {needed}")
    delimiter = separator[1] if separator else next((d for d in DELIMITERS if d in first), ",")
    file.seek(0)
    table = csv.reader(_lines(path, file, begin), delimiter=delimiter, skipinitialspace=True)
    try:
        # The first row below `begin` lines.
        top = next((row for row in table if row and table.line_num > begin), None)
        if top is None:
            raise UserError(f"{_where(path, table.line_num)}: there is no header")
        if any("\0" in name for name in top):
            raise UserError(f"{path}: {NO_TEXT}")
        header = [name.strip() for name in top]
        header[0] = header[0].lstrip("# ")
        columns = choose(header, table.line_num)
        values = _rows(path, table, len(header), columns, may_be_empty, increasing, os.fstat(file.fileno()).st_size)
    except csv.Error as error:
        raise UserError(f"{_where(path, table.line_num)}: not a readable CSV row ({error})") from None
    if len(values) < least:
        rows = "only one row below the header" if len(values) else "no rows below the header"
        raise UserError(f"{_where(path, table.line_num)}: {rows}; {needed}")
    return values


def _lines(path: Path, file: IO[str], begin: int) -> Iterator[str]:
    """The lines of the file; the first `begin` are replaced by blank ones, because a quote in a comment is not the beginning of a cell.
    Raises UserError for a line that would fill the memory."""
    number = 0
    while line := file.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE:
            raise UserError(f"{path}: a line has more than {LONGEST_LINE:,} characters; it is not a table")
        number += 1
        yield line if number > begin else "\n"


def _top(file: IO[str], skip: int) -> tuple[int, str]:
    """The number of lines above the header (`skip`, then blank lines or comments after `#`) and the header, "" if there is
    none. numpy also writes a `#` before the header: the header is then the last comment, directly above numbers."""
    for _ in range(skip):
        file.readline(LONGEST_LINE)
    count, comment, line = skip, "", file.readline(LONGEST_LINE)
    while line and (not line.strip() or line.lstrip().startswith("#")):
        count, comment, line = count + 1, line.strip() and line, file.readline(LONGEST_LINE)
    if comment and line.strip() and re.match(r"[-+.\d]", line.lstrip()):
        return count - 1, comment
    return count, line


def _rows(
    path: Path,
    table: Any,
    width: int,
    columns: Sequence[tuple[str, int]],
    may_be_empty: Container[str],
    increasing: bool,
    size: int,
) -> Array:
    """All rows below the header, (rows, columns). width: cells of the header. size: bytes of the file."""
    cells, previous, bytes_read, indices = array("d"), -math.inf, 0, [index for _, index in columns]
    comma, last = table.dialect.delimiter == ";", table.line_num
    marks: set[str] = set()
    with Progress(f"reading {path}", size) as progress:
        for count, row in enumerate(table):
            line = "".join(row)
            if "\n" in line or "\r" in line:
                raise UserError(
                    f"{_where(path, last + 1)}: a cell in quotes does not end in this row; close its quote, or write it in one row"
                )
            last = table.line_num
            # Some tools end each row, but not the header, with a separator.
            if len(row) != width and not (len(row) == width + 1 and not row[-1].strip()):
                if not any(map(str.strip, row)) or row[0].startswith("#"):
                    continue
                number = "1 cell" if len(row) == 1 else f"{len(row)} cells"
                raise UserError(f"{_where(path, table.line_num)}: {number}, but the header has {width}")
            try:
                values = [float(row[i].replace(",", ".") if comma else row[i]) for i in indices]
            except ValueError:
                values = [math.nan]
                # Excel may end a table with rows of blank cells.
                if not line.strip():
                    continue
            # float() would take 1_000 for a thousand
            if "_" in line or not math.isfinite(sum(values)):
                where = _where(path, table.line_num)
                values = [_number(f"{where}, column {n}", row[i], comma, n in may_be_empty) for n, i in columns]
            if comma and len(marks := marks.union(*(_MARKS.intersection(row[i]) for i in indices))) > 1:
                raise UserError(
                    f"{_where(path, table.line_num)}: decimal commas and decimal points are mixed from here on; write all numbers "
                    "with the same, and without separators of thousands"
                )
            if increasing and values[0] <= previous:
                message = "repeats the time of the previous row" if values[0] == previous else "runs backwards"
                raise UserError(
                    f"{_where(path, table.line_num)}, column time: {row[indices[0]].strip()} {message}"
                    f" (after {previous!r}); time must increase from row to row"
                )
            previous = values[0]
            cells.extend(values)
            bytes_read += len(line) + width
            if count % REPORT_ROWS == 0:
                progress(bytes_read)
    return np.array(cells).reshape(-1, len(columns))


def _number(where: str, cell: str, comma: bool, may_be_empty: bool) -> float:
    """The number in a cell, perhaps with a decimal comma. Raises a UserError whose message begins with `where`."""
    content = cell.strip()
    if may_be_empty and content.lower() in ("", "nan"):
        return math.nan
    try:
        value = None if "_" in content else float(content.replace(",", ".") if comma else content)
    except ValueError:
        value = None
    if value is None:
        raise UserError(f"{where}: {f'{content[:40]!r} is not a number' if content else 'empty cell'}")
    if not math.isfinite(value):
        raise UserError(f"{where}: {content} is not finite")
    return value


def _is_binary(path: Path) -> bool:
    """Returns whether a file contains a NUL near its beginning, as no text in the usual encodings does."""
    with open(path, "rb") as file:
        return b"\0" in file.read(1 << 12)


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
