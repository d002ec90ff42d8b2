"""The wheels of fmu-run and prw: what is in them, and what their libraries promise."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from email.parser import Parser
from pathlib import Path

import headers
import pytest
from bill_of_materials import WHEEL
from conftest import DIST, ROOT, prw_wheel, wheel
from packaging.utils import parse_wheel_filename
from targets import LINUX, LINUX_ARM, MAC, MAC_ARM, MODEL, TARGETS, WINDOWS

CRATE = ROOT / "crates" / "fmu-run"
LIBRARIES = {target: "fmu_run/_native.pyd" if target is WINDOWS else "fmu_run/_native.abi3.so" for target in TARGETS}
EXPORTED = {"PyInit__native"}


@pytest.fixture(params=TARGETS, ids=lambda target: target.triple)
def target(request):
    """Each target in turn."""
    return request.param


@pytest.fixture
def native(target, tmp_path) -> Path:
    """The library in the wheel for a target."""
    return Path(zipfile.ZipFile(wheel(target)).extract(LIBRARIES[target], tmp_path))


def test_one_for_each_platform_and_every_python():
    names = [path.name for path in DIST.glob("*.whl") if path != prw_wheel()]
    assert sorted(names) == sorted(wheel(target).name for target in TARGETS)
    for name in names:
        assert {(tag.interpreter, tag.abi) for tag in parse_wheel_filename(name)[3]} == {("cp311", "abi3")}


def test_twine_has_nothing_to_say():
    """Registries take them, with a description that can be shown."""
    command = [sys.executable, "-m", "twine", "check", "--strict", *sorted(DIST.glob("*.whl"))]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.count("PASSED") == len(TARGETS) + 1, done.stdout + done.stderr


def test_prw_has_the_fmu_inside():
    with zipfile.ZipFile(prw_wheel()) as archive:
        assert archive.read(f"prw/fmu/{MODEL}.fmu") == (DIST / f"{MODEL}.fmu").read_bytes()


def test_what_is_in_it(target):
    archive = zipfile.ZipFile(wheel(target))
    assert archive.testzip() is None
    (info,) = {name.split("/")[0] for name in archive.namelist() if ".dist-info/" in name}
    sources = {f"fmu_run/{path.name}": path for path in (CRATE / "python" / "fmu_run").iterdir() if path.is_file()}
    assert {"fmu_run/py.typed", "fmu_run/_native.pyi", "fmu_run/__init__.py"} <= set(sources)
    licences = ["LICENSE-MIT", "LICENSE-APACHE", WHEEL.notice.relative_to(CRATE).as_posix()]
    sources |= {f"{info}/licenses/{name}": CRATE / name for name in licences}
    sources[f"{info}/sboms/{WHEEL.bill.name}"] = WHEEL.bill
    made = {LIBRARIES[target], *(f"{info}/{name}" for name in ("METADATA", "WHEEL", "RECORD"))}
    assert set(archive.namelist()) == set(sources) | made
    for name, path in sources.items():
        assert archive.read(name) == path.read_bytes(), name
    metadata = Parser().parsestr(archive.read(f"{info}/METADATA").decode())
    assert metadata["License-Expression"] == "MIT OR Apache-2.0"
    assert sorted(metadata.get_all("License-File")) == sorted(licences)


@pytest.mark.parametrize("target", [LINUX, LINUX_ARM], indirect=True)
def test_linux(native, target):
    headers.linux(native, target, EXPORTED)


@pytest.mark.parametrize("target", [WINDOWS], indirect=True)
def test_windows(native):
    # python3.dll is what all versions of Python have in common.
    headers.windows(native, EXPORTED, "_native.dll", {"python3.dll", "bcryptprimitives.dll"})


@pytest.mark.parametrize("target", [MAC, MAC_ARM], indirect=True)
def test_macos(native, target):
    headers.macos(native, (target,), EXPORTED, "@rpath/fmu_run._native.abi3.so")
    (part,) = headers.slices(native)
    of_python = {s.name: s.binding_info.library_ordinal for s in part.imported_symbols if s.name.startswith("_Py")}
    # BIND_SPECIAL_DYLIB_FLAT_LOOKUP: looked for in the process that loads it, which is Python.
    assert of_python and set(of_python.values()) == {-2}


@pytest.mark.parametrize("target", [MAC_ARM], indirect=True)
def test_macos_runs_only_what_is_signed(native):
    headers.macos_signature(native)
