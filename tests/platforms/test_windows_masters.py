"""Programs that others wrote for Windows load the FMU there, under Wine.

* libcosim for Windows (from libcosimpy's wheel), with FMI Library in it: unpacks the FMU and steps it, called from C.
* Ecos for Windows (from ecospy's wheel), for FMI 2.0 and 3.0, in the same way.
* FMPy's program for Windows that loads an FMU and serves it to FMPy elsewhere (its "remoting"). It knows no FMI 3.0.

All are compiled with Microsoft's compiler.
"""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile

import fmpy.util
import numpy as np
import pytest
from conftest import DIST, FMI3, HERE, ROOT, RUNNERS, WINE, disagreement, downloaded, windows_path

#: The platforms of wheels.
LINUX, WINDOWS = "manylinux_2_28_x86_64", "win_amd64"


@pytest.fixture
def served(fmu, tmp_path):
    """The FMU with nothing but its Windows library, and FMPy's program to serve it from Wine."""
    path = tmp_path / "windows.fmu"
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            if not name.startswith("binaries/") or name.startswith("binaries/win64/"):
                target.writestr(name, source.read(name))
    fmpy.util.add_remoting(str(path), "linux64", "win64")
    return path


@pytest.fixture
def simulate(tmp_path, wine):
    """Simulates an FMU with FMPy in a process of its own (its remoting cannot be loaded twice in one)."""
    # The third argument names a file that FMPy keeps locked while it lives; Wine does not see Linux's locks.
    (tmp_path / "wine64").write_text(f'#!/bin/sh\nexec {WINE} "$1" "$2"\n')
    (tmp_path / "wine64").chmod(0o755)
    environment = {**wine, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}

    def run(fmu, kind):
        result = tmp_path / f"{fmu.stem}.csv"
        command = [sys.executable, str(HERE / "fmpy_run.py"), str(fmu), kind, str(result)]
        process = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120)
        assert process.returncode == 0, process.stdout + process.stderr
        return np.genfromtxt(result, delimiter=",", names=True), process.stdout

    return run


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_fmpys_server_for_windows(kind, simulate, served, fmu, capsys):
    (there, said), (here, _) = simulate(served, kind), simulate(fmu, kind)
    assert "prw_testbed.dll" in said
    assert there.dtype == here.dtype and len(there) == len(here) == 101
    largest = max(
        np.abs(there[name] - here[name]).max() / max(np.abs(here[name]).max(), 1e-9) for name in here.dtype.names
    )
    with capsys.disabled():
        print(f"\n{kind} by FMPy's server for Windows: largest relative difference {largest:.2g} ", end="")
    assert largest <= 1e-12
    assert np.abs(here["roll"]).max() > 0.05


def wheel(package: str, platform: str, requirements: str = "tests.txt") -> zipfile.ZipFile:
    """The wheel of a package for a platform, of the version that the other tests use."""
    return zipfile.ZipFile(downloaded(package, ROOT / "requirements" / requirements, platform))


@pytest.fixture
def libcosim(tmp_path):
    """libcosim for Linux and for Windows."""
    return {
        name: wheel("libcosimpy", platform).extract(f"libcosimpy/libcosimc/{library}", tmp_path)
        for name, platform, library in (("linux64", LINUX, "libcosimc.so"), ("win64", WINDOWS, "cosimc.dll"))
    }


def test_libcosim_for_windows(libcosim, run_c, fmu, capsys):
    def outputs(runner, path):
        said = run_c(runner, HERE / "libcosim.c", libcosim[runner.folder], path)
        assert f"Loading '{runner.folder}' binary" in said
        return "\n".join(line for line in said.splitlines() if line.startswith("outputs "))

    here, there = (runner for runner in RUNNERS if runner.folder in libcosim)
    largest, count = disagreement(outputs(there, windows_path(fmu)), outputs(here, str(fmu)))
    with capsys.disabled():
        print(f"\nlibcosim for Windows: {count} numbers, largest relative difference {largest:.2g} ", end="")
    assert count == 200 * 8 and largest <= 1e-12


@pytest.fixture
def ecos(tmp_path):
    """The libraries of Ecos for Linux and for Windows, after those that they need; and the program that it unpacks with."""
    both, tbb = (wheel(name, LINUX, "importers.txt") for name in ("ecospy", "tbb"))
    (needed,) = [name for name in tbb.namelist() if name.endswith("/libtbb.so.12")]
    subprocess.run([*RUNNERS[1].compiler, "-o", tmp_path / "unzip.exe", HERE / "windows" / "unzip.c"], check=True)
    return {
        "linux64": (tbb.extract(needed, tmp_path), both.extract("ecospy/binaries/libecosc.so", tmp_path)),
        "win64": (both.extract("ecospy/binaries/libecosc.dll", tmp_path),),
    }


def test_ecos_for_windows(ecos, run_c, fmu, unpacked, unpacked_fmi3, tmp_path, capsys):
    def outputs(version, runner):
        path, folder = {2: (fmu, unpacked), 3: (DIST / FMI3, unpacked_fmi3)}[version]
        named = windows_path(path) if runner.start else str(path)
        environment = {"WINEPATH": windows_path(tmp_path), "UNPACKED": windows_path(folder)}
        said = run_c(runner, HERE / "ecos.c", named, *ecos[runner.folder], **environment)
        assert ("Loading FMI version 3..." in said) == (version == 3)
        return "\n".join(line for line in said.splitlines() if line.startswith("outputs "))

    here, there = (runner for runner in RUNNERS if runner.folder in ecos)
    three = outputs(3, there)
    assert three == outputs(2, there)
    largest, count = disagreement(three, outputs(3, here))
    with capsys.disabled():
        print(f"\nFMI 3.0 in Ecos for Windows: {count} numbers, largest relative difference {largest:.2g} ", end="")
    assert count == 200 * 8 and largest <= 1e-12
