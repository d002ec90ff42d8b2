"""Fixtures that several test directories share. pyproject.toml lists further directories from which tests import modules."""

from __future__ import annotations

import contextlib
import io
import shutil
import subprocess
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import fmpy
import pytest
from built import built


@pytest.fixture(scope="session")
def fmu() -> Path:
    """The testbed for FMI 2.0."""
    return built("prw_testbed.fmu", "fmu")


@pytest.fixture(scope="session", params=["", "fmi3/"], ids=["fmi2", "fmi3"])
def version(request: pytest.FixtureRequest) -> str:
    """The directory of the FMUs in target/fmu: "" for FMI 2.0, and then "fmi3/" for FMI 3.0."""
    return str(request.param)


@pytest.fixture(scope="session")
def testbed(version: str) -> Path:
    """The testbed for FMI 2.0, and then for FMI 3.0."""
    return built(f"{version}prw_testbed.fmu", "fmu")


@pytest.fixture(scope="session")
def controller(version: str) -> Path:
    """The controller for FMI 2.0, and then for FMI 3.0."""
    return built(f"{version}prw_controller.fmu")


@pytest.fixture(scope="session")
def unpack() -> Iterator[Callable[[Path], str]]:
    """Returns a function that unpacks an FMU into a directory. The directories are removed after the tests."""
    directories: list[str] = []

    def unpack(fmu: Path) -> str:
        directories.append(str(fmpy.extract(str(fmu))))
        return directories[-1]

    yield unpack
    for directory in directories:
        shutil.rmtree(directory, ignore_errors=True)


@pytest.fixture
def prw(tmp_path: Path, fmu: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Returns a function that runs `prw` with arguments, in this process and a temporary directory. A UserWarning or RuntimeWarning is
    an error."""
    # The import is here because the environment of the platform tests has no prw.
    from prw.cli import main

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("prw.progress._wanted", False)

    def run(*arguments: object, with_fmu: bool = True) -> subprocess.CompletedProcess[str]:
        line = [*map(str, arguments), *(["--fmu", str(fmu)] if with_fmu else [])]
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err), warnings.catch_warnings():
            for category in (UserWarning, RuntimeWarning):
                warnings.simplefilter("error", category)
            try:
                status = main(line)
            except SystemExit as end:
                status = int(end.code or 0)
        return subprocess.CompletedProcess(line, status, out.getvalue(), err.getvalue())

    return run
