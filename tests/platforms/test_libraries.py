"""What the libraries export, import and promise, read from their headers."""

from __future__ import annotations

import re
from pathlib import Path

import fmpy
import headers
import pytest
from conftest import INCLUDED, library
from targets import FOLDERS, TARGETS

#: kB
LARGEST = 450

FMI2_FUNCTIONS = {f"fmi2{name}" for name in re.findall(r"F\((\w+)\)", (INCLUDED[0] / "fmu.h").read_text())}
#: Those of the header of the standard, which FMPy brings.
FMI3_HEADER = Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h"
FMI3_FUNCTIONS = set(re.findall(r"^FMI3_Export +fmi3\w+TYPE +(fmi3\w+);", FMI3_HEADER.read_text(), re.MULTILINE))
#: The library describes itself to the program that packs it.
FUNCTIONS = FMI2_FUNCTIONS | FMI3_FUNCTIONS | {"fmu_export_describe"}


def test_the_functions_are_known():
    assert len(FMI2_FUNCTIONS) == 44 and len(FMI3_FUNCTIONS) == 75


@pytest.fixture
def path(unpacked_models, model, folder) -> Path:
    """The library of each FMU in each folder."""
    return library(unpacked_models[model], folder)


def test_small(path, folder):
    assert path.stat().st_size <= len(FOLDERS[folder]) * LARGEST * 1000, path.stat().st_size


@pytest.mark.parametrize("folder", ["linux64", "aarch64-linux"], indirect=True)
def test_linux(path, folder):
    (target,) = FOLDERS[folder]
    headers.linux(path, target, FUNCTIONS)


@pytest.mark.parametrize("folder", ["win64"], indirect=True)
def test_windows(path):
    headers.windows(path, FUNCTIONS, path.name)


@pytest.mark.parametrize("folder", ["darwin64", "aarch64-darwin"], indirect=True)
def test_macos(path, folder, model):
    headers.macos(path, FOLDERS[folder], FUNCTIONS, f"@rpath/{model}.dylib")


@pytest.mark.parametrize("folder", ["darwin64", "aarch64-darwin"], indirect=True)
def test_macos_runs_only_what_is_signed(path):
    headers.macos_signature(path)


def test_every_target_is_in_the_fmu():
    assert {target for targets in FOLDERS.values() for target in targets} == set(TARGETS)
