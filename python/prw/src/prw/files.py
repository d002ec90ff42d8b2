"""Atomic writing of result files and of tables, and the files of the pages."""

from __future__ import annotations

import contextlib
import os
import secrets
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import orjson
from numpy.typing import NDArray

from prw.errors import UserError
from prw.progress import Progress

#: Rows that are written at once.
BLOCK = 8192

#: The package, and the clone around it or from which it was installed.
PACKAGE = Path(__file__).parent
_INSTALLED_FROM = PACKAGE / "clone.txt"
CLONE = (
    Path(_INSTALLED_FROM.read_text(encoding="utf-8"))
    if _INSTALLED_FROM.is_file()
    else Path(os.path.normpath(PACKAGE / "../../../.."))
)
#: Directories of a clone with the files of the pages.
PAGE_DIRECTORIES = ("crates/fmu-package/page", "docs/fmu-page/wrist")


def page_file(name: str) -> Path:
    """A script, style sheet or table of the pages that show the wrist."""
    locations = [PACKAGE / "page" / name, *(CLONE / directory / name for directory in PAGE_DIRECTORIES)]
    return next((path for path in locations if path.is_file()), locations[0])


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path next to `path`. The file replaces `path` if the block succeeds, and is removed otherwise.

    Creates missing directories. Raises UserError if the file cannot be written.
    """
    temporary = path.parent / f".{path.stem}-{secrets.token_hex(4)}{path.suffix}"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary.touch(exist_ok=False)
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink()


def write_text(path: str | os.PathLike[str] | None, text: str) -> str:
    """Return the string, and write it to `path`, if that is given, as UTF-8 with line feeds, atomically. Raises UserError if the
    file cannot be written."""
    if path is not None:
        with replacing(Path(path)) as temporary:
            temporary.write_bytes(text.encode("utf-8"))
    return text


def write_table(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write the columns (n,) by name as CSV, with a line of names. Numbers have as many digits as it takes to read them back
    unchanged."""
    # Adding 0.0 turns -0.0 into 0.0.
    table = np.column_stack(list(columns.values())) + 0.0
    with (
        replacing(path) as temporary,
        Progress(f"writing {path}", len(table)) as progress,
        open(temporary, "wb") as file,
    ):
        file.write((",".join(columns) + "\n").encode("ascii"))
        for start in range(0, len(table), BLOCK):
            # JSON: [[1.0,2.0],[3.0,4.0]], with null for NaN. Brackets become line ends.
            rows = orjson.dumps(table[start : start + BLOCK], option=orjson.OPT_SERIALIZE_NUMPY)
            file.write(rows[2:-2].replace(b"],[", b"\n").replace(b"null", b"nan") + b"\n")
            progress(start)
