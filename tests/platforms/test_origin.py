"""A release contains no paths of the machine that built it."""

from __future__ import annotations

import io
import os
import re
import tempfile
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import DIST, ROOT

#: Directories of this machine, and a pattern for directories of other machines.
DIRECTORIES = {str(ROOT), str(Path.home()), f"{tempfile.gettempdir()}/", "/.cargo/", "/.rustup/", "rustlib", "/usr/src"}
DIRECTORIES |= {os.environ[name] for name in ("CARGO_HOME", "CARGO_TARGET_DIR") if os.environ.get(name)}
OTHERS = re.compile(rb"/home/\w+/|/Users/\w+/|[A-Z]:\\(?:Users|a)\\", re.IGNORECASE)


def contents(name: str, content: bytes) -> Iterator[tuple[str, bytes]]:
    """Yields a file and all files in nested archives, and for C sources also the bytes that are written as numbers."""
    yield name, content
    if name.endswith(".c"):
        yield name, bytes(int(number, 16) for number in re.findall(rb"\b0x([0-9a-f]{2})\b", content))
    if content.startswith(b"PK\3\4"):
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            for info in archive.infolist():
                yield from contents(f"{name}: {info.filename}", archive.read(info))


def origins(name: str, content: bytes) -> list[str]:
    """Returns the directories that a file names, each with its location."""
    found = []
    for path, text in contents(name, content):
        for directory in DIRECTORIES:
            # Strings in Windows may have two bytes per character.
            if any(directory.encode(encoding) in text for encoding in ("utf-8", "utf-16-le")):
                found.append(f"{directory} in {path}")
        found += [f"{match.decode()} in {path}" for match in OTHERS.findall(text)]
    return found


@pytest.mark.parametrize("path", sorted(DIST.iterdir()), ids=lambda path: path.name)
def test_no_names_of_directories(path):
    assert origins(path.name, path.read_bytes()) == []


@pytest.mark.parametrize(
    "path",
    [f"{ROOT}/src/fmu.rs".encode(), f"{Path.home()}".encode("utf-16-le"), rb"/home/runner/work", rb"D:\a\prw\src"],
)
def test_a_name_is_found_in_an_archive_in_an_archive(path):
    content = b"\0\1" + path + b"\0"
    for name in ("library.so", "model.fmu"):
        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr(name, content)
        content = archive.getvalue()
    (found, *_) = origins("package.whl", content)
    assert found.endswith(" in package.whl: model.fmu: library.so")


def test_a_name_is_found_in_the_numbers_of_c_sources():
    numbers = ", ".join(f"0x{byte:02x}" for byte in f"{ROOT}/src/fmu.rs".encode())
    content = f"static const u8 data[] = {{ {numbers} }};\n".encode()
    assert origins("model.c", content) and not origins("model.txt", content)
