"""The FMU as C sources: every compiler takes them, and what they make answers as the library does."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from pathlib import Path

import fmpy
import numpy as np
import pytest
from conftest import COMPILERS, FMU, ROOT, SOURCE_FMU, Compiler
from fmpy.fmi2 import FMU2Slave

HERE = Path(__file__).parent
OUTPUTS = ("tau1", "tau2", "pitch", "roll")
STRICT = ("-std=c99", "-pedantic-errors")


@pytest.fixture(scope="module")
def description() -> fmpy.model_description.ModelDescription:
    """The description of the source FMU, checked against the schema."""
    return fmpy.read_model_description(str(SOURCE_FMU), validate=True)


def references(description: fmpy.model_description.ModelDescription) -> list[int]:
    """Of the motor angles and the outputs."""
    by_name = {variable.name: variable.valueReference for variable in description.modelVariables}
    return [by_name[name] for name in ("theta1", "theta2", *OUTPUTS)]


def answers_of_the_library(description: fmpy.model_description.ModelDescription) -> str:
    """What steps.c prints of its answers, from the FMU with the library."""
    unpacked = fmpy.extract(str(FMU))
    slave = FMU2Slave(
        guid=description.guid, unzipDirectory=unpacked, modelIdentifier="prw_testbed", instanceName="library"
    )
    slave.instantiate()
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    vr = references(description)
    answers = 0xCBF29CE484222325
    for i in range(2000):
        t = i * 0.001
        slave.setReal(vr[:2], [t * (1 - t), t * (t - 0.5)])
        slave.doStep(currentCommunicationPoint=t, communicationStepSize=0.001)
        for byte in struct.pack("<4d", *slave.getReal(vr[2:])):
            answers = (answers ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    slave.terminate()
    slave.freeInstance()
    shutil.rmtree(unpacked, ignore_errors=True)
    return f"{answers:016x}"


def run(
    compiler: Compiler, sources: Path, folder: Path, guid: str, vr: list[int], *options: str
) -> dict[str, list[str]]:
    """Compiles steps.c with the sources and runs it; what it prints, by the first word."""
    program = folder / "steps"
    files = [str(HERE / "steps.c"), str(sources / "prw_testbed.c"), "-lm"]
    compiler.compile(sources, program, "-g", *options, *files)
    command = [*(compiler.start or ()), str(program), guid, *map(str, vr)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    printed: dict[str, list[str]] = {}
    for line in done.stdout.splitlines():
        word, _, rest = line.partition(" ")
        printed.setdefault(word, []).append(rest)
    return printed


@pytest.mark.parametrize("name", COMPILERS)
def test_the_sources_are_strict_c99(name: str, sources: Path, tmp_path: Path) -> None:
    compiler = COMPILERS[name]
    compiler.require()
    for file in ("prw_testbed.c", "prw_testbed_fmi2.c"):
        messages = compiler.compile(sources, tmp_path / "object.o", *STRICT, "-Wall", "-O1", "-c", str(sources / file))
        assert "error" not in messages


#: What compilers do by themselves, and with all they may: in GNU mode gcc would fuse products and sums.
OPTIONS = {
    "gcc": [("-std=c99", "-O0"), ("-O2",), ("-O3", "-march=native")],
    "clang": [("-O2",)],
    "aarch64": [("-std=gnu99", "-O2"), ("-O3", "-ffp-contract=fast")],
    "armhf": [("-O2",)],
}


@pytest.mark.parametrize(("name", "options"), [(name, o) for name, several in OPTIONS.items() for o in several])
def test_every_processor_answers_as_the_library(
    name: str,
    options: tuple[str, ...],
    sources: Path,
    tmp_path: Path,
    description: fmpy.model_description.ModelDescription,
) -> None:
    compiler = COMPILERS[name]
    compiler.require()
    printed = run(compiler, sources, tmp_path, description.guid, references(description), *options)
    assert printed["answers"] == [answers_of_the_library(description)] * 2
    assert printed["allocations"] == ["after fmi2Instantiate: 0"]
    # High-water marks: twice as much is there.
    assert int(printed["stack"][0]) < 32768
    assert int(printed["memory"][0]) * 65536 < int(printed["block"][0])
    # 4 is fmi2Fatal, which is what such an instance answers from then on.
    assert printed["damaged"] == ["4", "4"]
    assert all("free this instance" in line for line in printed["log"])


@pytest.mark.parametrize("sanitizer", ["address,undefined", "thread"])
def test_sanitizers_are_silent(
    sanitizer: str, sources: Path, tmp_path: Path, description: fmpy.model_description.ModelDescription
) -> None:
    options = (f"-fsanitize={sanitizer}", "-fno-sanitize-recover=all", "-O1", "-DTHREADS=4", "-pthread")
    vr = references(description)
    printed = run(COMPILERS["gcc"], sources, tmp_path, description.guid, vr, *options)
    assert len(set(printed["thread"])) == 1 and set(printed["thread"]) == set(printed["answers"])


def test_other_arithmetic_is_refused(sources: Path, tmp_path: Path) -> None:
    file = str(sources / "prw_testbed_fmi2.c")
    for options, message in (
        (("-ffast-math",), "compile without -ffast-math"),
        (("-mfpmath=387",), "add -msse2"),
        (("-U__BYTE_ORDER__", "-D__BYTE_ORDER__=__ORDER_BIG_ENDIAN__"), "little-endian"),
    ):
        arguments = (*options, "-E", file)
        assert message in COMPILERS["gcc"].compile(sources, tmp_path / "out", *arguments, check=False)


def test_no_symbol_clashes_and_nothing_is_global(sources: Path, tmp_path: Path) -> None:
    """With the standard's header in place of FMPy's, which leaves the prefix out."""
    headers = tmp_path / "headers"
    headers.mkdir()
    text = (Path(fmpy.__file__).parent / "c-code" / "fmi2Functions.h").read_text()
    paste = "#define P_(a, b) a##b\n#define P(a, b) P_(a, b)\n#define fmi2FullName(name) P(FMI2_FUNCTION_PREFIX, name)"
    prefixed = text.replace("#define fmi2FullName(name) name", paste)
    assert prefixed != text
    (headers / "fmi2Functions.h").write_text(prefixed)
    symbols = []
    for file in ("prw_testbed.c", "prw_testbed_fmi2.c"):
        output = tmp_path / "object.o"
        COMPILERS["gcc"].compile(sources, output, f"-I{headers}", "-O1", "-c", str(sources / file))
        names = subprocess.run(["nm", "--defined-only", str(output)], check=True, capture_output=True, text=True).stdout
        symbols += [line.split()[1:] for line in names.splitlines()]
    kinds = {kind for kind, _ in symbols}
    # t, T: functions; r: constants; d: constants that have addresses in them.
    assert kinds <= {"t", "T", "r", "R", "d"}
    assert all("elem_segment_exprs" in name for kind, name in symbols if kind == "d")
    public = [name for kind, name in symbols if kind.isupper()]
    own = ("prw_testbed_", "w2c_prw__testbed_", "wasm2c_prw__testbed_")
    assert len(public) > 88
    assert all(name.startswith(own) for name in public)
    assert sum(name.startswith("prw_testbed_fmi2") for name in public) == 44


def test_fmpy_compiles_and_runs_it(tmp_path: Path) -> None:
    compiled = tmp_path / "compiled.fmu"
    fmpy.util.compile_platform_binary(str(SOURCE_FMU), str(compiled))
    t = np.linspace(0, 1, 1001)
    types = [("time", float), ("theta1", float), ("theta2", float), ("omega1", float), ("omega2", float)]
    motors = np.array(list(zip(t, np.sin(t), t**2, np.cos(t), 2 * t, strict=True)), dtype=types)
    for interface in ("CoSimulation", "ModelExchange"):
        results = [
            fmpy.simulate_fmu(str(fmu), fmi_type=interface, input=motors, stop_time=1, output_interval=1e-3)
            for fmu in (FMU, compiled)
        ]
        assert len(results[0]) > 1000
        assert results[0].tobytes() == results[1].tobytes()


def test_the_tests_of_the_library_pass(sources: Path, tmp_path: Path) -> None:
    """Random sessions, with every answer compared; and the tests of the C interface, on the compiled sources."""
    library = tmp_path / "compiled.so"
    files = [str(sources / name) for name in ("prw_testbed.c", "prw_testbed_fmi2.c")]
    # Arrays of 5000 values are among the arguments.
    COMPILERS["gcc"].compile(sources, library, "-O1", "-fPIC", "-shared", "-DFMU_MEMORY_PAGES=64", *files, "-lm")
    command = [
        "cargo",
        "test",
        "--locked",
        "--quiet",
        "--test",
        "c_sources",
        "--test",
        "fmu",
        "--",
        "--include-ignored",
    ]
    # Here a saved state belongs to its instance, which those hand to another.
    command += ["--skip", "replay_is_bit_identical", "--skip", "states_of_the_other_standard"]
    environment = {**os.environ, "FMU_LIBRARY": str(library)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
