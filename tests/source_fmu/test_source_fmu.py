"""The FMU as C sources: several compilers accept them, and the results are bit-identical to the results of the library."""

from __future__ import annotations

import os
import re
import shutil
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

import fmpy
import numpy as np
import pytest
import rebuild
from conftest import COMPILERS, CONTROLLER, FMU, HEADERS, ROOT, SOURCE_FMU, references, unpack
from fmpy.fmi2 import FMU2Slave

HERE = Path(__file__).parent
STRICT = ("-std=c99", "-pedantic-errors", "-Wall", "-Wextra", "-Werror")
#: Default of FMU_MEMORY_PAGES, the memory of an instance in units of 64 KiB: two that the testbed needs from the beginning, and
#: two more for saved states.
MEMORY = 4


@pytest.fixture(scope="module")
def description() -> fmpy.model_description.ModelDescription:
    """The description of the source FMU, checked against the schema."""
    return fmpy.read_model_description(str(SOURCE_FMU), validate=True)


@pytest.fixture(scope="module")
def library_hash() -> str:
    """Returns the hash that steps.c must print: the hash of the same outputs, computed with the FMU that contains the library."""
    unpacked, description = fmpy.extract(str(FMU)), fmpy.read_model_description(str(FMU))
    slave = FMU2Slave(
        guid=description.guid, unzipDirectory=unpacked, modelIdentifier="prw_testbed", instanceName="library"
    )
    slave.instantiate()
    slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    vr = references(description)
    value = 0xCBF29CE484222325
    for i in range(2000):
        t = i * 0.001
        slave.setReal(vr[:2], [t * (1 - t), t * (t - 0.5)])
        slave.doStep(currentCommunicationPoint=t, communicationStepSize=0.001)
        for byte in struct.pack("<4d", *slave.getReal(vr[2:])):
            value = (value ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    slave.terminate()
    slave.freeInstance()
    shutil.rmtree(unpacked, ignore_errors=True)
    return f"{value:016x}"


@pytest.fixture
def run(
    sources: Path,
    tmp_path: Path,
    description: fmpy.model_description.ModelDescription,
    environment: dict[str, str],
) -> Callable[..., dict[str, list[str]]]:
    """Returns a function that compiles steps.c with the sources, runs it, and returns the printed lines by their first word."""

    def compile_and_run(name: str, *options: str, sources: Path = sources, code: int = 0) -> dict[str, list[str]]:
        compiler = COMPILERS[name]
        compiler.require()
        program = tmp_path / "steps.exe"
        files = [str(HERE / "steps.c"), str(sources / "prw_testbed.c"), "-lm"]
        compiler.compile(sources, program, "-g", *options, *files)
        command = [*compiler.start, str(program), description.guid, *map(str, references(description))]
        done = subprocess.run(command, env=environment, capture_output=True, text=True)
        assert done.returncode == code, done.stdout + done.stderr
        printed: dict[str, list[str]] = {}
        for line in done.stdout.splitlines():
            word, _, rest = line.partition(" ")
            printed.setdefault(word, []).append(rest)
        return printed

    return compile_and_run


@pytest.mark.parametrize("name", COMPILERS)
def test_the_sources_are_strict_c99(name: str, sources: Path, tmp_path: Path) -> None:
    compiler = COMPILERS[name]
    compiler.require()
    for file in ("prw_testbed.c", "prw_testbed_fmi2.c"):
        compiler.compile(sources, tmp_path / "object.o", *STRICT, "-O1", "-c", str(sources / file))


#: Options for gcc that `make test` runs, too.
SMALL = ("-std=c99", "-O0")
#: Usual options, and options that permit more optimization. In GNU mode, gcc fuses products and sums unless sources forbid it.
OPTIONS = {
    "gcc": [SMALL, ("-O2",), ("-O3", "-march=native")],
    "clang": [("-O2",), ("-O3", "-march=native")],
    "mingw": [("-O2",)],
    "aarch64": [("-std=gnu99", "-O2"), ("-O3", "-ffp-contract=fast")],
    "clang for aarch64": [("-O2",)],
    "riscv64": [("-std=gnu99", "-O2")],
    "armhf": [("-O2",)],
}


@pytest.mark.parametrize(
    ("name", "options"),
    [
        pytest.param(name, options, marks=pytest.mark.small if options is SMALL else ())
        for name, several in OPTIONS.items()
        for options in several
    ],
)
def test_every_processor_equals_the_library(
    name: str, options: tuple[str, ...], run: Callable[..., dict[str, list[str]]], library_hash: str
) -> None:
    printed = run(name, *options)
    assert printed["hash"] == [library_hash] * 4
    assert printed["allocations"] == ["after fmi2Instantiate: 0"]
    # The most stack and memory that the steps have used.
    assert 1000 < int(printed["stack"][0]) < 32768
    assert 2 <= int(printed["memory"][0]) < MEMORY
    assert MEMORY * 65536 < int(printed["block"][0]) < (MEMORY + 1) * 65536
    # 3 is fmi2Error. The instance remains usable.
    assert printed["full"] == ["3", "3"]
    # How many states fit depends a little on where other memory is, but saving and freeing a hundred times loses none.
    states = [int(count) for count in printed["states"]]
    assert min(states) > 20 and len(states[2:]) == 100 and len(set(states[2:])) == 1
    rejected = [
        line for line in printed["log"] if "free some, or compile the FMU with a larger FMU_MEMORY_PAGES" in line
    ]
    assert len(rejected) >= len(states) + len(printed["full"])
    # 4 is fmi2Fatal, which an instance with damaged memory returns from then on.
    assert printed["damaged"] == ["4", "4"]
    rest = [line for line in printed["log"] if line not in rejected]
    assert rest and all("free this instance" in line for line in rest)


def test_fused_products_and_sums_are_rejected(
    sources: Path, tmp_path: Path, run: Callable[..., dict[str, list[str]]]
) -> None:
    """The sources cannot switch off -ffp-contract=fast for clang. For gcc they can, by a pragma, which is removed here."""
    changed = tmp_path / "changed"
    shutil.copytree(sources, changed)
    runtime = changed / "prw_testbed_runtime.h"
    text = runtime.read_text()
    assert text.count('#pragma GCC optimize("fp-contract=off")') == 1
    runtime.write_text(text.replace('#pragma GCC optimize("fp-contract=off")', ""))
    for name, directory in (("clang for aarch64", sources), ("aarch64", changed)):
        printed = run(name, "-O3", "-ffp-contract=fast", sources=directory, code=1)
        assert list(printed) == ["log"] and "add -ffp-contract=off" in printed["log"][0]


def test_more_memory_keeps_more_states(run: Callable[..., dict[str, list[str]]], library_hash: str) -> None:
    few, many = (run("gcc", "-O1", f"-DFMU_MEMORY_PAGES={pages}") for pages in (MEMORY, 2 * MEMORY))
    assert int(many["states"][0]) > 2 * int(few["states"][0])
    assert many["hash"] == few["hash"] == [library_hash] * 4


def test_files_with_different_memories_do_not_link(sources: Path, tmp_path: Path) -> None:
    objects = []
    for file, pages in (("prw_testbed.c", 4), ("prw_testbed_fmi2.c", 5)):
        objects.append(str(tmp_path / f"{file}.o"))
        options = ("-O0", "-fPIC", "-c", f"-DFMU_MEMORY_PAGES={pages}")
        COMPILERS["gcc"].compile(sources, Path(objects[-1]), *options, str(sources / file))
    arguments = ("-shared", "-Wl,--no-undefined", *objects, "-lm")
    messages = COMPILERS["gcc"].compile(sources, tmp_path / "library.so", *arguments, check=False)
    assert "undefined reference to `wasm2c_prw__testbed_instantiate_5'" in messages


@pytest.mark.parametrize("sanitizer", ["address,undefined", "thread"])
def test_sanitizers_are_silent(sanitizer: str, run: Callable[..., dict[str, list[str]]]) -> None:
    options = (f"-fsanitize={sanitizer}", "-fno-sanitize-recover=all", "-O1", "-DTHREADS=4", "-pthread")
    printed = run("gcc", *options)
    assert len(printed["thread"]) == 4
    assert set(printed["thread"]) == set(printed["hash"])


def test_other_arithmetic_is_rejected(sources: Path, tmp_path: Path) -> None:
    file = str(sources / "prw_testbed_fmi2.c")
    for options, message in (
        (("-ffast-math",), "compile without -ffast-math"),
        (("-ffinite-math-only",), "compile without -ffast-math"),
        (("-mfpmath=387",), "add -msse2"),
        (("-U__BYTE_ORDER__", "-D__BYTE_ORDER__=__ORDER_BIG_ENDIAN__"), "little-endian"),
    ):
        arguments = (*options, "-E", file)
        assert message in COMPILERS["gcc"].compile(sources, tmp_path / "out", *arguments, check=False)


@pytest.fixture(scope="module")
def prefixing(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Returns the option for a header that prefixes the names of functions, as the standard's does; FMPy's header omits the prefix."""
    headers = tmp_path_factory.mktemp("headers")
    text = (HEADERS / "fmi2Functions.h").read_text()
    paste = "#define P_(a, b) a##b\n#define P(a, b) P_(a, b)\n#define fmi2FullName(name) P(FMI2_FUNCTION_PREFIX, name)"
    prefixed = text.replace("#define fmi2FullName(name) name", paste)
    assert prefixed != text
    (headers / "fmi2Functions.h").write_text(prefixed)
    return f"-I{headers}"


def test_no_symbol_clashes_and_nothing_is_global(sources: Path, tmp_path: Path, prefixing: str) -> None:
    symbols = []
    for file in ("prw_testbed.c", "prw_testbed_fmi2.c"):
        output = tmp_path / "object.o"
        COMPILERS["gcc"].compile(sources, output, prefixing, "-O1", "-c", str(sources / file))
        names = subprocess.run(["nm", "--defined-only", str(output)], check=True, capture_output=True, text=True).stdout
        symbols += [line.split()[1:] for line in names.splitlines()]
    kinds = {kind for kind, _ in symbols}
    # t, T: functions; r, R: constants; d: constants that contain addresses, which the loader writes. Capitals are for public symbols.
    assert kinds <= {"t", "T", "r", "R", "d"}
    assert all("elem_segment_exprs" in name for kind, name in symbols if kind == "d")
    public = [name for kind, name in symbols if kind.isupper()]
    own = ("prw_testbed_", "w2c_prw__testbed_", "wasm2c_prw__testbed_")
    assert len(public) > 88
    assert all(name.startswith(own) for name in public)
    assert sum(name.startswith("prw_testbed_fmi2") for name in public) == 44


def test_two_fmus_are_linked_into_one_program(sources: Path, tmp_path: Path, prefixing: str) -> None:
    controller = unpack(CONTROLLER, tmp_path / "controller")
    files = [str(directory / f"{name}{end}.c")
             for directory, name in ((sources, "prw_testbed"), (controller, "prw_controller")) for end in ("", "_fmi2")]  # fmt: skip
    program = tmp_path / "two"
    options = (prefixing, f"-I{controller}", "-O1", str(HERE / "two.c"))
    COMPILERS["gcc"].compile(sources, program, *options, *files, "-lm")
    guids = [fmpy.read_model_description(str(fmu)).guid for fmu in (SOURCE_FMU, CONTROLLER)]
    done = subprocess.run([program, *guids], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "testbed\ncontroller\n")


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


@pytest.fixture(scope="module")
def unpacked_without_guid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory `sources` of the FMU, with zeros as guid, as in the model that Rust tests contain."""
    directory = unpack(SOURCE_FMU, tmp_path_factory.mktemp("zeros"))
    guid = fmpy.read_model_description(str(SOURCE_FMU)).guid
    listed, zeros = ([f"0x{byte:02x}" for byte in text.encode()] for text in (guid, re.sub(r"\w", "0", guid)))
    code = directory / "prw_testbed.c"
    text, count = re.subn(r",\s+".join(listed), ", ".join(zeros), code.read_text(encoding="utf-8"))
    assert count == 1
    code.write_text(text, encoding="utf-8")
    return directory


def cargo_test(library: Path, *arguments: str, profile: str = "release", **environment: str) -> str:
    """Runs Rust tests on a library compiled from the C sources, and returns their output."""
    command = ["cargo", "test", "--locked", "--profile", profile, *arguments]
    environment = {**os.environ, "FMU_LIBRARY": str(library), **environment}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def compile_library(sources: Path, directory: Path, *options: str, model: str = "prw_testbed") -> Path:
    """Compiles the sources of a model with gcc to a library in the directory."""
    COMPILERS["gcc"].require()
    library, files = directory / f"{model}.so", [str(sources / f"{model}{end}.c") for end in ("", "_fmi2")]
    COMPILERS["gcc"].compile(sources, library, *options, "-fPIC", "-shared", *files, "-lm")
    return library


#: The random sessions pass arrays of 5000 values, for which the default memory is too small.
LARGE = "-DFMU_MEMORY_PAGES=64"


def test_the_tests_of_the_library_pass(unpacked_without_guid: Path, tmp_path: Path) -> None:
    """Compares all results of random sessions, and runs the tests of the C interface, on the compiled sources."""
    library = compile_library(unpacked_without_guid, tmp_path, "-O2", LARGE)
    output = cargo_test(library, "--test", "c_sources", "--test", "fmu", "--", "--include-ignored", "--nocapture")
    assert f"in {os.environ.get('SESSIONS', '300')} sessions" in output


@pytest.mark.small
def test_random_sessions(unpacked_without_guid: Path, tmp_path: Path) -> None:
    """Runs fewer sessions than the test above. With `--workspace`, cargo reuses what `make test` has compiled."""
    library = compile_library(unpacked_without_guid, tmp_path, "-O0", LARGE)
    arguments = ("--workspace", "--test", "c_sources", "--", "--ignored", "--nocapture")
    assert "in 30 sessions" in cargo_test(library, *arguments, profile="dev", SESSIONS="30")


def test_random_sessions_with_sanitizers(unpacked_without_guid: Path, tmp_path: Path) -> None:
    options = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-O1", "-g")
    library = compile_library(unpacked_without_guid, tmp_path, *options, LARGE)
    asan = subprocess.run(["gcc", "-print-file-name=libasan.so"], check=True, capture_output=True, text=True).stdout
    rustc = subprocess.run(["rustc", "-vV"], check=True, capture_output=True, text=True).stdout
    (host,) = (line.removeprefix("host: ") for line in rustc.splitlines() if line.startswith("host: "))
    # The program is not instrumented, so the sanitizer's library is loaded first.
    runner = {f"CARGO_TARGET_{host.upper().replace('-', '_')}_RUNNER": f"env LD_PRELOAD={asan.strip()}"}
    arguments = ("--test", "c_sources", "--", "--ignored", "--nocapture")
    output = cargo_test(library, *arguments, SESSIONS="100", ASAN_OPTIONS="detect_leaks=0", **runner)
    assert "in 100 sessions" in output


def test_a_panic_ends_its_instance_only(tmp_path: Path) -> None:
    """Runs, on several threads, the tests of a model that panics in most of its functions."""
    file = ROOT / "crates" / "fmu-export" / "tests" / "panics" / "library.rs"
    command = ["cargo", "run", "--locked", "--release", "--package", "fmu-package", "--example", "c_sources"]
    environment = {"WASM2C": str(ROOT / ".venv" / "bin" / "wasm2c"), **os.environ}
    subprocess.run([*command, file, "faulty", tmp_path], cwd=ROOT, env=environment, check=True)
    library = compile_library(tmp_path, tmp_path, "-O1", model="faulty")
    assert "1 passed" in cargo_test(library, "--package", "fmu-export", "--test", "panics", "--", "--ignored")


def test_a_build_in_another_directory_is_identical(tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    rebuild.copy_sources(copy)
    environment = {"WASM2C": str(ROOT / ".venv" / "bin" / "wasm2c"), **os.environ}
    environment["CARGO_TARGET_DIR"] = str(tmp_path / "target")
    command = ["cargo", "run", "--locked", "--release", "--bin", "build_fmu", "--", "--c-sources", "--out", tmp_path]
    subprocess.run(command, cwd=copy, env=environment, check=True)
    assert (tmp_path / "source" / "prw_testbed.fmu").read_bytes() == SOURCE_FMU.read_bytes()
