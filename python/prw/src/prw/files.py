"""Atomic writing of result files and tables, reading of small files, and the files of the pages."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import secrets
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import orjson
from numpy.typing import NDArray

from prw.errors import UserError
from prw.progress import Progress

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

#: Number of rows that are written with one call.
BLOCK = 8192

#: The directory of the package, and the clone that contains it or from which it was installed.
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
    """The path of a script, style sheet or table of the pages that show the wrist. If the file is missing, its path in the
    package."""
    locations = [PACKAGE / "page" / name, *(CLONE / directory / name for directory in PAGE_DIRECTORIES)]
    return next((path for path in locations if path.is_file()), locations[0])


#: Maximum size of a file that is read as a whole, in bytes.
MAX_BYTES = 64 << 20


def check_regular(path: Path) -> None:
    """Raise OSError unless it is a regular file: a pipe would wait for a writer, and a device may never end."""
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "it is not a regular file")


def read_text(path: Path) -> str:
    """The content of a small file, as UTF-8. Raises OSError and UnicodeError."""
    check_regular(path)
    with open(path, "rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise OSError(errno.EFBIG, f"it has more than {MAX_BYTES >> 20} MB")
    return content.decode("utf-8")


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path next to `path`. The file replaces `path` if the block succeeds, and is removed otherwise.
    Temporary files of killed processes are removed first.

    Creates missing directories. Raises UserError if the file cannot be written.
    """
    descriptor, temporary = None, path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_abandoned(path)
        # Another process may lock and remove the file before this one locks it.
        while descriptor is None or not temporary.exists():
            if descriptor is not None:
                os.close(descriptor)
            temporary = path.parent / f".{path.stem}-{secrets.token_hex(4)}{path.suffix}"
            descriptor = os.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o666)
            with contextlib.suppress(BlockingIOError):
                _lock(descriptor)
        yield temporary
        # Otherwise the file may be empty after a power failure.
        os.fsync(descriptor)
        os.close(descriptor)
        descriptor = None
        os.replace(temporary, path)
    except OSError as error:
        raise UserError(f"{path}: cannot be written ({error.strerror or error})") from None
    finally:
        if descriptor is not None:
            os.close(descriptor)
        if temporary != path:
            with contextlib.suppress(OSError):
                temporary.unlink()


@contextlib.contextmanager
def locked(directory: Path) -> Iterator[None]:
    """Lock a directory during the block, except on Windows. Creates it if necessary. Raises UserError if it cannot be created, or if
    another process has locked it."""
    with contextlib.ExitStack() as stack:
        try:
            directory.mkdir(parents=True, exist_ok=True)
            if fcntl is not None:
                descriptor = os.open(directory, os.O_RDONLY)
                stack.callback(os.close, descriptor)
                _lock(descriptor)
        except BlockingIOError:
            raise UserError(f"{directory}: another process is writing there; wait for it, or write elsewhere") from None
        except OSError as error:
            raise UserError(f"{directory}: cannot be written ({error.strerror or error})") from None
        yield


def _lock(descriptor: int) -> None:
    """Lock a file until the process ends or closes it. Raises OSError if another process has locked it. Does
    nothing on Windows."""
    if fcntl is not None:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _remove_abandoned(path: Path) -> None:
    """Remove the temporary files for `path` that no process has locked. On Windows, files that are in use cannot be removed."""
    name = re.compile(re.escape(f".{path.stem}-") + "[0-9a-f]{8}" + re.escape(path.suffix))
    for entry in path.parent.iterdir():
        if not name.fullmatch(entry.name) or entry.is_symlink() or not entry.is_file():
            continue
        with contextlib.suppress(OSError):
            descriptor = os.open(entry, os.O_RDWR)
            try:
                _lock(descriptor)
                entry.unlink()
            finally:
                os.close(descriptor)


def write_text(path: str | os.PathLike[str] | None, text: str) -> str:
    """Return the string, and write it to `path`, if that is given, as UTF-8 with line feeds, atomically. Raises UserError if the
    file cannot be written."""
    if path is not None:
        with replacing(Path(path)) as temporary:
            temporary.write_bytes(text.encode("utf-8"))
    return text


def write_table(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write the columns (n,) by name as CSV, with a line of names. Numbers have as many digits as are needed to read
    them back unchanged."""
    # Adding 0.0 turns -0.0 into 0.0.
    table = np.column_stack(list(columns.values())) + 0.0
    with (
        replacing(path) as temporary,
        Progress(f"writing {path}", len(table)) as progress,
        open(temporary, "wb") as file,
    ):
        file.write((",".join(columns) + "\n").encode("ascii"))
        for start in range(0, len(table), BLOCK):
            # JSON: [[1.0,2.0],[3.0,4.0]], with null for a number that is not finite. Brackets become line ends.
            rows = orjson.dumps(table[start : start + BLOCK], option=orjson.OPT_SERIALIZE_NUMPY)
            file.write(rows[2:-2].replace(b"],[", b"\n").replace(b"null", b"nan") + b"\n")
            progress(start)
