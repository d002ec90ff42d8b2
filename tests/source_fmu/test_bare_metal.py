"""The C sources without an operating system: a Cortex-M7 with double precision, which QEMU emulates, runs the experiments of Fig. 4."""

from __future__ import annotations

import csv
import io
import re
import shutil
import struct
import subprocess
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
import toolchain
from conftest import FMU, HEADERS, OUTPUTS, ROOT, SOURCE_FMU, references
from fmpy.fmi2 import FMU2Slave

HERE = Path(__file__).parent / "bare_metal"
COMPILER = "arm-none-eabi-gcc"
EMULATOR = "qemu-system-arm"
#: Each instruction takes 1,024 ns, so SysTick, whose clock has 25 MHz, counts 25.6 ticks for each.
BOARD = "-M mps2-an500 -nographic -semihosting-config enable=on,target=native -icount shift=10"
PROCESSOR = ("-mcpu=cortex-m7", "-mfloat-abi=hard", "-mfpu=fpv5-d16")
EXPERIMENTS = ("fig4_equal", "fig4_opposite")
PAGE = ROOT / "docs" / "real-time.md"


def motions() -> np.ndarray:
    """Returns the motor angles of both experiments, (experiment, step, motor), rad."""
    tables = []
    with zipfile.ZipFile(SOURCE_FMU) as archive:
        for name in EXPERIMENTS:
            text = archive.read(f"extra/org.fmi-standard.fmi-ls-ref/{name}_in.csv").decode()
            rows = list(csv.DictReader(io.StringIO(text)))
            tables.append([[float(row["theta1"]), float(row["theta2"])] for row in rows[:-1]])
    return np.array(tables)


def header(guid: str, vr: list[int], angles: np.ndarray) -> str:
    """Returns motion.h, with all bits of the angles."""

    def braces(values: object) -> str:
        return "{" + ",\n".join(map(braces, values)) + "}" if isinstance(values, list) else values.hex()

    def listed(numbers: list[int]) -> str:
        return "{" + ", ".join(map(str, numbers)) + "}"

    return (
        f'#define GUID "{guid}"\n#define STEPS {angles.shape[1]}\n'
        f"static const fmi2ValueReference input_references[] = {listed(vr[:2])};\n"
        f"static const fmi2ValueReference output_references[] = {listed(vr[2:])};\n"
        f"static const double angles[2][STEPS][2] = {braces(angles.tolist())};\n"
    )


def of_library(vr: list[int], angles: np.ndarray) -> list[str]:
    """Returns the bits of the outputs of the library, a line for each step."""
    unpacked, description = fmpy.extract(str(FMU)), fmpy.read_model_description(str(FMU))
    slave = FMU2Slave(
        guid=description.guid, unzipDirectory=unpacked, modelIdentifier="prw_testbed", instanceName="library"
    )
    slave.instantiate()
    lines = []
    for table in angles:
        slave.reset()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        for number, row in enumerate(table):
            slave.setReal(vr[:2], row.tolist())
            slave.doStep(currentCommunicationPoint=number * 0.001, communicationStepSize=0.001)
            lines.append(" ".join(struct.pack(">d", value).hex() for value in slave.getReal(vr[2:])))
    slave.freeInstance()
    shutil.rmtree(unpacked, ignore_errors=True)
    return lines


def test_the_experiments_of_fig4_run_without_an_operating_system(sources: Path, tmp_path: Path) -> None:
    toolchain.need(COMPILER, EMULATOR)
    description = fmpy.read_model_description(str(SOURCE_FMU))
    vr, angles = references(description), motions()
    (tmp_path / "motion.h").write_text(header(description.guid, vr, angles))
    program = tmp_path / "fig4.elf"
    files = [HERE / "startup.c", HERE / "fig4.c", sources / "prw_testbed_fmi2.c", sources / "prw_testbed.c"]
    options = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-ffunction-sections", "-fdata-sections"]
    includes = [f"-I{directory}" for directory in (HEADERS, sources, tmp_path, HERE)]
    linked = ["-nostartfiles", "-Wl,--gc-sections", "-T", str(HERE / "mps2_an500.ld")]
    command = [COMPILER, *PROCESSOR, *options, *includes, *linked, *map(str, files), "-lm", "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    emulate = [EMULATOR, *BOARD.split(), "-kernel", str(program)]
    ran = subprocess.run(emulate, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    lines = [line.strip().partition(" ") for line in (ran.stdout + ran.stderr).splitlines()]
    assert ran.returncode == 0, ran.stdout[-500:] + ran.stderr[-500:]
    assert [rest for word, _, rest in lines if word == "outputs"] == of_library(vr, angles)
    assert len(OUTPUTS) * angles.shape[1] > 3000 and not any(word == "log" for word, *_ in lines)
    numbers = {word: int(rest, 16) for word, _, rest in lines if word != "outputs"}
    size = re.split(r"\s+", subprocess.check_output(["arm-none-eabi-size", program], text=True).splitlines()[1].strip())
    motion = angles.nbytes
    per_instruction = numbers["ticks"] / 20_000
    found = {name: round(numbers[name] / per_instruction) for name in ("mean", "most", "first")}
    table = {
        "instructions of a step: mean": found["mean"],
        "instructions of a step: most": found["most"],
        "instructions of the first step, which calculates the matrices of its size": found["first"],
        "memory for the program, bytes": int(size[0]) + int(size[1]) - motion,
        "memory for the instance, bytes": numbers["allocated"],
        "stack, bytes": numbers["stack"],
    }
    print("".join(f"| {name} | {value:,} |\n" for name, value in table.items()))
    # The page was written with one version of the compiler; another one needs a little more or less.
    stated = dict(re.findall(r"^\| (.*) \| ([\d,]+) \|$", PAGE.read_text(encoding="utf-8"), re.M))
    for name, value in table.items():
        assert value == pytest.approx(int(stated[name].replace(",", "")), rel=0.1), name
