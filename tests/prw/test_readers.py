"""Recordings and parameters that are malformed, endless or not files give an error of one line."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, example, given, seed, settings
from hypothesis import strategies as st

from prw.arguments import values_of
from prw.errors import LONGEST, UserError, one_line
from prw.recording import read

GOOD = "time,theta1,theta2\n0,0.1,0.2\n0.001,0.1,0.2\n0.002,0.1,0.2\n"
#: Parts of tables; most combinations are malformed.
PARTS = st.sampled_from(
    [
        *"0123456789-+.eE_;,\t#\"' \n\r",
        "nan",
        "inf",
        "1e999",
        "time",
        "theta1",
        "theta2",
        "omega1",
        "[deg]",
        "(",
        "\x00",
        "\x1b[2J",
    ]
    + ["\u0665", "\u202e", "\ufeff", "\n0.003,0.1,0.2\n", "time,theta1,theta2\n", "9" * 400]
)
TABLES = st.one_of(st.binary(max_size=200), st.lists(PARTS, max_size=60).map(lambda parts: "".join(parts).encode()))
#: The search is the same in each run, without a database of earlier runs and without a time limit.
SEARCH = settings(max_examples=300, deadline=None, database=None, suppress_health_check=list(HealthCheck))


def message(path: Path, **options: Any) -> str:
    """Reads a recording. Returns the error message, or an empty string if there is no error."""
    try:
        read(path, **options)
    except UserError as error:
        return str(error)
    return ""


def is_one_line(text: str, path: Path) -> bool:
    """Returns whether a message starts with the path, is not too long, and has only characters that a terminal prints."""
    return (
        text.startswith(str(path)) and all(c.isprintable() or c == "\u3000" for c in text) and len(text) < LONGEST + 10
    )


@seed(1)
@SEARCH
@example(GOOD.encode())
@example(b'time,theta1,theta2\n0,0.1,"0.2\n' + b"1,1,1\n" * 15_000)
@example(b'#\n"')
@example(b"\xff\xfe")
@given(TABLES)
def test_tables_are_read_or_explained(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzzed.csv"
    path.write_bytes(content)
    for options in ({}, {"encoding": "latin-1", "skip": 1}, {"degrees": True}):
        why = message(path, **options)
        assert not why or is_one_line(why, path), ascii(why)


@seed(1)
@SEARCH
@given(st.integers(0, 2), st.integers(0, len(GOOD) - 1), PARTS)
def test_changed_tables_are_read_or_explained(
    tmp_path_factory: pytest.TempPathFactory, removed: int, at: int, part: str
) -> None:
    path = tmp_path_factory.getbasetemp() / "changed.csv"
    path.write_bytes((GOOD[:at] + part + GOOD[at + removed :]).encode())
    why = message(path)
    assert not why or is_one_line(why, path), ascii(why)


def limited(code: str, directory: Path) -> str:
    """Runs Python with at most a gigabyte of memory, and returns its output."""
    resource = pytest.importorskip("resource", reason="POSIX has limits on memory")
    limit = lambda: resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))  # noqa: E731
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=directory,
        capture_output=True,
        text=True,
        preexec_fn=limit,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def test_devices_pipes_and_endless_lines_are_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with open(tmp_path / "line", "wb") as file:
        file.truncate(3 << 30)
    code = """if True:
        import prw
        from prw.arguments import values_of
        from prw.errors import UserError
        for path in ("/dev/zero", "pipe", "line", "."):
            for reader in (prw.read, lambda path: values_of(path, None)):
                try:
                    reader(path)
                except UserError as error:
                    print(error)
    """
    found = limited(code, tmp_path).splitlines()
    assert len(found) == 8, found
    assert sum("is not a regular file" in line for line in found) == 4, found
    assert all("Is a directory" in line for line in found[6:]), found
    assert "a line has more than" in found[4] and "it has more than 64 MB" in found[5], found


def test_deep_json_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "deep.json"
    path.write_text("[" * 100_000)
    with pytest.raises(UserError, match="is not a JSON file"):
        values_of(path, Any)  # type: ignore[arg-type]


def test_messages_are_one_line() -> None:
    assert one_line("x \u00e4\u3000") == "x \u00e4\u3000"
    assert one_line("\x1b[31m\r\n\u202e\x9b\udcff") == "\\x1b[31m\\r\\n\\u202e\\x9b\\udcff"
    assert one_line("n" * 5000) == "n" * LONGEST + "..."


def test_names_of_files_need_not_be_utf_8(tmp_path: Path) -> None:
    path = os.fsdecode(os.fsencode(tmp_path) + b"/\xff\x1b[31m.csv")
    with contextlib.suppress(OSError):
        Path(path).write_bytes(b"x")
        code = "import prw.cli, sys; sys.exit(prw.cli.main(sys.argv[1:]))"
        command = [sys.executable, "-c", code, "simulate", "--input", path]
        done = subprocess.run(command, capture_output=True, cwd=tmp_path)
        assert done.returncode == 1 and done.stderr.count(b"\n") == 1, done.stderr
        assert b"\\udcff\\x1b[31m.csv" in done.stderr and b"Traceback" not in done.stderr


def test_sigterm_removes_temporary_files(tmp_path: Path) -> None:
    code = """if True:
        import os, signal, sys, types
        from pathlib import Path
        from prw import cli
        from prw.files import replacing
        def end(_):
            with replacing(Path("result.csv")):
                os.kill(os.getpid(), signal.SIGTERM)
                signal.pause()
        command = types.SimpleNamespace(HELP="", run=end)
        cli.run("prw", "", {"wait": command}, ["wait"])
    """
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 143 and list(tmp_path.iterdir()) == [], done.stderr
