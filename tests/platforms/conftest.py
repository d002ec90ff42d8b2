"""Fixtures: the FMUs in dist/, their libraries, and C programs that run on each platform."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

import fmpy
import pytest
import toolchain
from built import ROOT
from targets import FOLDERS, MODEL, MODELS, Target

DIST = Path(os.environ.get("DIST", ROOT / "dist"))

# It asserts for the tests.
pytest.register_assert_rewrite("headers")


#: The FMU for FMI 3.0.
FMI3 = f"{MODEL}-fmi3.fmu"
FMUS = (DIST / f"{MODEL}.fmu", DIST / FMI3)

#: Debian's package wine64 alone has it only there.
WINE = "/usr/lib/wine/wine64"


@dataclass(frozen=True)
class Runner:
    """How C programs are compiled and started for a platform, and its folders of `binaries/` in FMI 2.0 and 3.0."""

    folder: str
    fmi3_folder: str
    compiler: tuple[str, ...]
    start: tuple[str, ...] = ()
    links: tuple[str, ...] = ()


HERE = Path(__file__).parent
#: The loader of fmu-export's tests, and the standard's own headers, which FMPy brings.
INCLUDED = (HERE.parent.parent / "crates" / "fmu-export" / "tests" / "c", Path(fmpy.__file__).parent / "c-code")
WARNINGS = ("-std=c11", "-D_GNU_SOURCE", "-O2", "-Wall", "-Wextra", "-Werror", *(f"-I{folder}" for folder in INCLUDED))
RUNNERS = (
    Runner("linux64", "x86_64-linux", ("cc", *WARNINGS), links=("-ldl", "-lm")),
    Runner(
        "win64",
        "x86_64-windows",
        ("x86_64-w64-mingw32-gcc", *WARNINGS, "-D__USE_MINGW_ANSI_STDIO=1", "-I", str(HERE / "windows")),
        start=(WINE,),
    ),
    Runner(
        "aarch64-linux",
        "aarch64-linux",
        ("aarch64-linux-gnu-gcc", *WARNINGS),
        start=("qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"),
        links=("-ldl", "-lm"),
    ),
)


def pytest_configure():
    """Stops early where something is missing."""
    if not (DIST / f"{MODEL}.fmu").is_file():
        pytest.exit(f"{DIST / MODEL}.fmu is missing; make it with `make release`", returncode=1)
    toolchain.need("x86_64-w64-mingw32-gcc", "aarch64-linux-gnu-gcc", "qemu-aarch64", WINE)


@pytest.fixture(scope="session")
def fmu() -> Path:
    """The FMU for all platforms."""
    return DIST / f"{MODEL}.fmu"


def unpack(fmu: Path, folder: Path) -> Path:
    """Unpacks an FMU into a folder."""
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    return folder


@pytest.fixture(scope="session")
def unpacked_models(tmp_path_factory) -> dict[str, Path]:
    """The folders of the unpacked FMUs for FMI 2.0."""
    return {model: unpack(DIST / f"{model}.fmu", tmp_path_factory.mktemp(model)) for model in MODELS}


@pytest.fixture(scope="session")
def unpacked(unpacked_models) -> Path:
    """The folder of the unpacked FMU."""
    return unpacked_models[MODEL]


@pytest.fixture(scope="session")
def unpacked_fmi3(tmp_path_factory) -> Path:
    """The folder of the unpacked FMU for FMI 3.0."""
    return unpack(DIST / FMI3, tmp_path_factory.mktemp("fmi3"))


@pytest.fixture(scope="session")
def description(fmu):
    """FMPy's model description, checked against the XSD as it is read."""
    return fmpy.read_model_description(str(fmu), validate=True)


def library(unpacked: Path, folder: str) -> Path:
    """The library in a folder of `binaries/`."""
    (path,) = (unpacked / "binaries" / folder).iterdir()
    return path


@pytest.fixture(scope="session")
def wine(tmp_path_factory) -> dict[str, str]:
    """The environment for Windows programs: a Windows of their own, without windows."""
    prefix = tmp_path_factory.mktemp("wine")
    environment = {**os.environ, "WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "WINEARCH": "win64"}
    environment["WINEDLLOVERRIDES"] = "mscoree,mshtml="
    environment.pop("DISPLAY", None)
    subprocess.run([WINE, "wineboot", "--init"], env=environment, capture_output=True, timeout=300)
    return environment


@pytest.fixture(params=RUNNERS[1:], ids=lambda runner: runner.folder)
def foreign(request) -> Runner:
    """Each platform but this one."""
    return request.param


@pytest.fixture(params=MODELS)
def model(request) -> str:
    """Each FMU in turn."""
    return request.param


@pytest.fixture(params=FOLDERS)
def folder(request) -> str:
    """Each folder of `binaries/` in turn."""
    return request.param


@pytest.fixture(scope="session")
def include(description, tmp_path_factory) -> Path:
    """A folder with variables.h: guid, value references, and what depends on what; those of FMI 3.0 are higher by 1."""

    def reference(variable) -> str:
        return f"(FIRST + {variable.valueReference})"

    by_name = {variable.name: variable for variable in description.modelVariables}
    outputs = [unknown.variable for unknown in description.outputs]
    derivatives = [unknown.variable for unknown in description.derivatives]
    inputs = [variable for variable in by_name.values() if variable.causality == "input"]
    lines = [
        f'#define GUID "{description.guid}"',
        "#ifdef FMI3",
        "#define FIRST 1",
        "#else",
        "#define FIRST 0",
        "#endif",
    ]
    lines += [f"#define VR_{name} {reference(variable)}" for name, variable in by_name.items() if name.isidentifier()]
    for name, variables in (
        ("outputs", outputs),
        ("unknowns", outputs + derivatives),
        ("knowns", inputs + [variable.derivative for variable in derivatives]),
    ):
        references = ", ".join(map(reference, variables))
        lines.append(f"#define {name.upper()} {{{references}}}")
    folder = tmp_path_factory.mktemp("include")
    (folder / "variables.h").write_text("\n".join(lines) + "\n")
    return folder


@pytest.fixture(scope="session")
def run_c(include, wine, tmp_path_factory):
    """Compiles a C file for a platform and runs it; gives what it prints."""
    programs, outputs = {}, {}

    def run(runner: Runner, source: Path, *arguments: str, options: tuple[str, ...] = (), **environment: str) -> str:
        if (runner, source, options) not in programs:
            program = tmp_path_factory.mktemp(runner.folder) / f"{source.stem}.exe"
            command = [*runner.compiler, *options, "-I", include, "-o", program, source, *runner.links]
            subprocess.run(command, check=True)
            programs[runner, source, options] = program
        program = programs[runner, source, options]
        if (program, arguments) not in outputs:
            command = [*runner.start, program, *arguments]
            process = subprocess.run(command, env={**wine, **environment}, capture_output=True, text=True)
            assert process.returncode == 0, f"{runner.folder}: {process.stderr[-2000:]}{process.stdout[-2000:]}"
            outputs[program, arguments] = process.stdout
        return outputs[program, arguments]

    return run


def downloaded(package: str, requirements: Path, platform: str, python: str = "3.12") -> Path:
    """The file of a package for a platform, of the version in `requirements`; "sdist" is its sources'."""
    # With a sum, if it has one.
    pattern = rf"^({package}==([\d.]+)(?: --hash=\S+)?)"
    ((pinned, version),) = re.findall(pattern, requirements.read_text(), re.MULTILINE)
    folder = ROOT / "target" / "wheels" / platform
    file = f"{package.replace('-', '_')}-{version}[-.]*"
    if not list(folder.glob(file)):
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-deps"]
        if platform == "sdist":
            command += [f"--no-binary={package}"]
        else:
            command += ["--only-binary=:all:", "--python-version", python, "--platform", platform]
        folder.mkdir(parents=True, exist_ok=True)
        # Only in a file may a sum stand beside a version.
        with tempfile.NamedTemporaryFile("w", suffix=".txt") as wanted:
            print(pinned, file=wanted, flush=True)
            subprocess.run([*command, "--dest", folder, "-r", wanted.name], check=True)
    (path,) = folder.glob(file)
    return path


def wheel(target: Target) -> Path:
    """The wheel of fmu-run for a target."""
    (path,) = DIST.glob(f"fmu_run-*{target.wheel}*.whl")
    return path


def prw_wheel() -> Path:
    """The wheel of prw."""
    (path,) = DIST.glob("prw-*-py3-none-any.whl")
    return path


def ran(command, environment, **options) -> str:
    """What a program prints; its end is an error if it is none."""
    # Python for Windows wants a standard input.
    process = subprocess.run(command, env=environment, input="", capture_output=True, text=True, **options)
    assert process.returncode == 0, f"{' '.join(map(str, command))}\n{process.stdout}{process.stderr}"
    return process.stdout


def windows_path(path) -> str:
    """The path of a file as Wine has it."""
    return "Z:" + str(path).replace("/", "\\")


def parse(text: str) -> list[tuple[str, list[float]]]:
    """Lines of a name and numbers; a line of text is a name."""
    lines = []
    for line in text.splitlines():
        name, *numbers = line.split(" ")
        try:
            lines.append((name, [float(number) for number in numbers]))
        except ValueError:
            lines.append((line, []))
    return lines


def disagreement(ours: str, theirs: str) -> tuple[float, int]:
    """The largest difference, relative to the largest number under that name and column, and how many numbers."""
    ours, theirs = parse(ours), parse(theirs)
    assert [(name, len(numbers)) for name, numbers in ours] == [(name, len(numbers)) for name, numbers in theirs]
    largest: dict[tuple[str, int], float] = {}
    for name, numbers in theirs:
        for column, number in enumerate(numbers):
            largest[name, column] = max(largest.get((name, column), 0), abs(number))
    differences = [
        abs(a - b) / largest[name, column]
        for (name, mine), (_, other) in zip(ours, theirs)
        for column, (a, b) in enumerate(zip(mine, other))
        if a != b
    ]
    return max(differences, default=0.0), sum(len(numbers) for _, numbers in ours)
