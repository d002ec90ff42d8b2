"""Times the FMUs against programs in C and other tools; `make bench`.

It prints Markdown tables and writes their numbers to dev/benches/ratios.json, from which `make docs` writes
docs/performance.md. Each time is the minimum of several rounds. In the tables of steps and of runs, each round measures
all programs, one after the other. If the environment variable BENCH_QUICK is set, the counts are small and the file is
target/bench/quick.json, only to show that the benchmarks run.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterable
from ctypes import c_double, c_uint32
from pathlib import Path
from typing import Any

import fmpy
import fmu_run
import numpy as np
from fmpy.simulation import instantiate_fmu

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "dev"), str(ROOT / "tests")]
from c_models import pack  # noqa: E402

from tools.validation import masters  # noqa: E402
from tools.validation.system import read  # noqa: E402

FMUS, WORK = ROOT / "target" / "fmu", ROOT / "target" / "bench"
RATIOS = Path(__file__).with_name("ratios.json")
QUICK = "BENCH_QUICK" in os.environ
#: Communication step sizes, s. Multiples of EXACT have no rounding errors.
STEP, EXACT = 1e-3, 2.0**-10
SAMPLES, RUNS, ROUNDS, LOOPS = (21, 4, 1, 2) if QUICK else (2001, 2000, 7, 1000)
#: Numbers of instances, each with the number of steps.
SIZES = ((1, 50), (8, 5)) if QUICK else ((1, 50_000), (1024, 300), (16384, 40))
MOTORS, OUTPUTS = ("theta1", "theta2"), ("tau1", "tau2", "pitch", "roll")
#: Kinds of steps of bench.c, in its order, each with the number of steps of a measurement.
WAYS = {
    "angles set, step, 4 outputs, as vectors": 100_000,
    "the same, one scalar per call": 100_000,
    "with input derivatives": 100_000,
    "with use_omega and rates set": 100_000,
    "step size alternating among 4": 100_000,
    "steps of the grid np.arange(n) * 1e-3": 100_000,
    "a new step size every step": 4_000,
    "fmi2GetFMUstate and Set every step": 100_000,
    "8 x 10 directional derivatives": 20_000,
}
VECTORS, RATES, OMEGA, ALTERNATING, GRID, NEW_SIZES = 0, 2, 3, 4, 5, 6


#: The numbers of all tables, by the name of the table and the label of the row.
FIGURES: dict[str, dict[str, list[float]]] = {}


def table(name: str, *rows: Iterable[object]) -> None:
    """Prints a table and stores its numbers in FIGURES."""
    lines = [f"| {' | '.join(f'{x:,.3g}' if isinstance(x, float) else str(x) for x in row)} |\n" for row in rows]
    lines.insert(1, "|---" * lines[0].count(" |") + "|\n")
    print("", *lines, sep="", flush=True)
    found = [list(row) for row in rows[1:]]
    FIGURES[name] = {str(label): [float(f"{x:.3g}") for x in figures] for label, *figures in found}


def write_figures() -> None:
    """Writes the numbers of all tables."""
    path = WORK / "quick.json" if QUICK else RATIOS
    path.write_text(json.dumps(FIGURES, indent=2) + "\n", encoding="utf-8")


def compile_c(output: str, *arguments: object) -> None:
    headers = Path(fmpy.__file__).parent / "c-code"
    command = ["cc", "-I", headers, "-o", WORK / output, *arguments, "-ldl", "-lpthread", "-lm"]
    subprocess.run([str(word) for word in command], check=True)


def prepare(fmu: Path) -> str:
    """Writes the libraries and programs of the benchmarks into target/bench. Returns the guid of the FMU."""
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    with zipfile.ZipFile(fmu) as archive:
        (WORK / "fmu.so").write_bytes(archive.read("binaries/linux64/prw_testbed.so"))
    strict, directory = ("-Wall", "-Wextra", "-Werror"), ROOT / "dev" / "benches" / "c"
    for library in ("bare_exact", "euler"):
        compile_c(f"{library}.so", "-O3", *strict, "-shared", "-fPIC", directory / f"{library}.c")
    compile_c("bench", "-O2", *strict, directory / "bench.c")
    return str(fmpy.read_model_description(str(fmu)).guid)


def bench(library: object, guid: str, *arguments: object, stdin: bytes = b"") -> tuple[float, np.ndarray]:
    """Runs bench.c. Returns the number that it prints, and all outputs as one array."""
    command = [str(word) for word in (WORK / "bench", library, guid, *arguments)]
    done = subprocess.run(command, input=stdin, capture_output=True)
    if done.returncode:
        raise SystemExit(f"error: {' '.join(command)}: {done.stderr.decode()}")
    return float(done.stderr), np.frombuffer(done.stdout)


def steps(guid: str, sources: Path | None) -> None:
    """Compares steps of the FMU with the C programs. If the FMU's C sources are given, also compares them with its library."""

    guids = {"sources": str(fmpy.read_model_description(str(sources)).guid)} if sources else {}

    def seconds(library: str, way: int, count: int, threads: int = 1) -> float:
        repetitions = count // 100 if QUICK else count
        return bench(WORK / f"{library}.so", guids.get(library, guid), way, repetitions, threads)[0]

    def outputs(library: str, way: int) -> np.ndarray:
        return bench(WORK / f"{library}.so", guids.get(library, guid), way, 2000, 0)[1].reshape(-1, 4)

    others = [("euler", OMEGA, 20_000)]
    if sources:
        with zipfile.ZipFile(sources) as archive:
            archive.extractall(WORK / "source")
        files = sorted((WORK / "source" / "sources").glob("*.c"))
        compile_c("sources.so", "-O3", "-shared", "-fPIC", *files)
        np.testing.assert_array_equal(outputs("sources", VECTORS), outputs("fmu", VECTORS))
        others.append(("sources", VECTORS, 100_000))
    for way in (VECTORS, RATES, OMEGA, ALTERNATING, GRID):
        np.testing.assert_allclose(outputs("bare_exact", way), outputs("fmu", way), rtol=0, atol=1e-10)
    measured: dict[object, list[float]] = {}
    for _ in range(1 if QUICK else 25):
        for way, count in enumerate(WAYS.values()):
            for library in ("fmu", "bare_exact"):
                measured.setdefault((library, way), []).append(seconds(library, way, count))
        for library, way, count in others:
            measured.setdefault(library, []).append(seconds(library, way, count))
        for threads in (1, 2):
            measured.setdefault(threads, []).append(seconds("fmu", VECTORS, 400_000, threads))
    least = {name: min(found) for name, found in measured.items()}
    ratios = [(name, least["fmu", way] / least["bare_exact", way]) for way, name in enumerate(WAYS)]
    table("steps", ("time of the FMU / time of bare_exact.c", "ratio"), *ratios)
    one, exact, euler = least["fmu", VECTORS], outputs("fmu", RATES), outputs("euler", OMEGA)
    torque, roll = (100 * np.abs(euler - exact)[:, k].max() / np.abs(exact[:, k]).max() for k in (0, 3))
    rows = {
        "step of the FMU, ns": 1e9 * one,
        "steps of np.arange(n) * 1e-3 / steps of one size": least["fmu", GRID] / one,
        "four alternating sizes / steps of one size": least["fmu", ALTERNATING] / one,
        "new step size / known step size": least["fmu", NEW_SIZES] / one,
        "two threads / one, throughput": least[1] / least[2],
        "forward Euler in C / FMU": least["euler"] / one,
        "error of forward Euler in roll, % of the peak": roll,
        "error of forward Euler in torque, % of the peak": torque,
        "memory of an instance / 4 KiB": bench(WORK / "fmu.so", guid, "memory")[0] / 4096,
    }
    if sources:
        rows["step of the C sources / step of the library"] = least["sources"] / one
    table("others", ("other numbers", "value"), *rows.items())


class Case:
    """An FMU with time series (samples,) of its inputs by name, the names of its outputs, and a number of runs."""

    def __init__(self, name: str, fmu: Path, inputs: dict[str, np.ndarray], outputs: list[str], runs: int):
        self.name, self.inputs, self.outputs, self.runs = name, inputs, outputs, runs
        self.description = fmpy.read_model_description(str(fmu))
        self.directory = fmpy.extract(str(fmu))
        references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.references = [references[name] for name in inputs], [references[name] for name in outputs]
        self.table = np.ascontiguousarray(np.column_stack(list(inputs.values())))
        self.slave = instantiate_fmu(self.directory, self.description, fmi_type="CoSimulation")
        self.loaded = fmu_run.Fmu(fmu)
        # fmu_run makes one run for each element of an array of start values.
        self.start = {next(iter(inputs)): np.full(runs, self.table[0, 0])}

    def close(self) -> None:
        self.slave.freeInstance()
        self.loaded.close()
        shutil.rmtree(self.directory)

    def in_c(self, step: float) -> tuple[float, np.ndarray]:
        """Seconds per run in C with steps of `step` s, and the outputs (samples, n) of the last run."""
        library = Path(self.directory, "binaries", "linux64", f"{self.description.coSimulation.modelIdentifier}.so")
        lists = (",".join(map(str, references)) for references in self.references)
        arguments = (self.runs, SAMPLES, step, *lists, 1)
        seconds, rows = bench(library, self.description.guid, *arguments, stdin=self.table.tobytes())
        return seconds / self.runs, rows.reshape(SAMPLES, -1)

    def by_fmu_run(self, step: float, threads: int, **kept: Any) -> tuple[float, fmu_run.Runs]:
        begin = time.perf_counter()
        given: dict[str, Any] = {"inputs": self.inputs, "start": self.start, "outputs": self.outputs, **kept}
        runs = self.loaded.run(np.arange(SAMPLES) * step, threads=threads, **given)
        return (time.perf_counter() - begin) / self.runs, runs.check()

    def by_fmpy(self) -> tuple[float, np.ndarray]:
        """Seconds of one run by FMPy's wrappers of the C functions, which read and write rows of arrays in place; and the outputs."""
        slave, component = self.slave, self.slave.component
        (n_in, n_out), found = map(len, self.references), np.empty((SAMPLES, len(self.outputs)))
        into, out_of = ((c_uint32 * len(vr))(*vr) for vr in self.references)
        in_row, out_row, inputs = c_double * n_in, c_double * n_out, self.table
        begin = time.perf_counter()
        slave.reset()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        for k in range(SAMPLES):
            slave.fmi2SetReal(component, into, n_in, in_row.from_buffer(inputs, k * inputs.strides[0]))  # type: ignore[arg-type]
            slave.fmi2GetReal(component, out_of, n_out, out_row.from_buffer(found, k * found.strides[0]))  # type: ignore[arg-type]
            if k + 1 < SAMPLES:
                slave.fmi2DoStep(component, k * STEP, STEP, True)
        slave.terminate()
        return time.perf_counter() - begin, found

    def row(self) -> tuple[object, ...]:
        rounds = []
        for _ in range(ROUNDS):
            (c, expected), (one, runs), (two, _) = self.in_c(STEP), self.by_fmu_run(STEP, 1), self.by_fmu_run(STEP, 2)
            measured = self.by_fmu_run(STEP, 1, measures=["peak", "rms", "end"])[0]
            exact_c, exact = self.in_c(EXACT)[0], self.by_fmu_run(EXACT, 1)[0]
            fmpy_, found = self.by_fmpy()
            for number, name in enumerate(self.outputs):
                for values in (runs[name][-1], found[:, number]):
                    np.testing.assert_allclose(values, expected[:, number], rtol=0, atol=1e-12)
            rounds.append((c, exact_c, exact, one, two, measured, fmpy_))
        c, exact_c, exact, one, two, measured, fmpy_ = map(min, zip(*rounds))
        return self.name, exact / exact_c, one / c, measured / c, one / two, fmpy_ / one


def many_runs() -> None:
    """Compares many runs from Python with a loop in C and with FMPy. All of them store equal outputs at every step."""
    wave = 2 * np.sin(10 * np.pi * np.arange(SAMPLES) * STEP / 2) ** 2 / (10 * np.pi)
    motors = {"theta1": wave, "theta2": -wave}
    wrist = {"pitch_ref": 3 * wave, "roll_ref": -2 * wave, "pitch": 2 * wave, "roll": -wave}
    with tempfile.TemporaryDirectory() as directory:
        ramp = pack(Path(directory) / "ramp.fmu", "integrator", "misbehaving2", {"{misbehaving}": "{ramp}"})
        cases = (
            Case("testbed", FMUS / "prw_testbed.fmu", motors, ["tau1", "pitch", "roll", "roll_rate"], RUNS),
            Case("controller", FMUS / "prw_controller.fmu", wrist, ["theta1", "theta2", "omega1", "omega2"], RUNS),
            Case("a ramp in C", ramp, {"slope": 1 + wave}, ["y"], 2 * RUNS),
        )
        heads = (
            "one thread / C, equal steps",
            "np.arange(n) * 1e-3",
            "the same, statistics",
            "two threads, throughput",
        )
        table("runs", ("FMU", *heads, "FMPy / one thread"), *(case.row() for case in cases))
        for case in cases:
            case.close()


def exchange() -> None:
    """Compares Model Exchange with FMPy's CVode, which keeps its instance for all runs, and one thread with two."""
    grid = np.arange(SAMPLES) * STEP
    angle, rate = 0.3 * np.sin(14 * grid), 4.2 * np.cos(14 * grid)
    cases: dict[str, dict[str, np.ndarray]] = {
        "free vibration": {},
        "a moving motor": {"theta1": angle, "omega1": rate},
    }
    start: dict[str, Any] = {"start_at_rest": False, "theta5_start": 0.3}
    path = FMUS / "prw_testbed.fmu"
    description, directory = fmpy.read_model_description(str(path)), fmpy.extract(str(path))
    slave = instantiate_fmu(directory, description, fmi_type="ModelExchange")
    rows = []
    with fmu_run.Fmu(path) as fmu:
        for name, inputs in cases.items():
            types = [("time", np.float64), *[(one, np.float64) for one in inputs]]
            signals = np.array(list(zip(grid, *inputs.values())), dtype=types) if inputs else None
            kept: dict[str, Any] = {"outputs": ["roll", "tau1"], "interface": "model_exchange", "rtol": 1e-6}

            def by_fmpy(signals: Any = signals) -> tuple[float, np.ndarray]:
                begin = time.perf_counter()
                found = fmpy.simulate_fmu(
                    directory,
                    model_description=description,
                    fmu_instance=slave,
                    fmi_type="ModelExchange",
                    stop_time=grid[-1],
                    output_interval=STEP,
                    relative_tolerance=1e-6,
                    start_values=start,
                    input=signals,
                    output=["roll", "tau1"],
                )
                seconds = time.perf_counter() - begin
                slave.reset()
                return seconds, found["roll"]

            def ours(threads: int, inputs: Any = inputs, kept: Any = kept) -> tuple[float, np.ndarray]:
                begin, runs = time.perf_counter(), RUNS // 20 or 2
                values = {**start, "k1": np.full(runs, 120.5)}
                found = fmu.run(grid, inputs=inputs, start=values, threads=threads, **kept).check()["roll"]
                return (time.perf_counter() - begin) / runs, found[0]

            if not inputs:
                np.testing.assert_allclose(ours(1)[1], by_fmpy()[1], rtol=0, atol=1e-3)
            one = least(ours, 1)
            rows.append((name, least(by_fmpy) / one, one / least(ours, 2)))
    slave.freeInstance()
    shutil.rmtree(directory)
    table("exchange", ("testbed in Model Exchange", "FMPy with CVode / one thread", "two threads, throughput"), *rows)


def least(body: Callable[..., tuple[float, Any]], *arguments: Any) -> float:
    return min(body(*arguments)[0] for _ in range(ROUNDS))


def instances(guid: str) -> None:
    """Compares stateful instances with a loop in C over as many instances. The results are bit-identical."""
    with fmu_run.Fmu(FMUS / "prw_testbed.fmu") as fmu:

        def in_c(count: int, moves: np.ndarray) -> tuple[float, np.ndarray]:
            lists = ("0,1", ",".join(str(list(fmu.variables).index(name)) for name in OUTPUTS))
            arguments = (1, len(moves), STEP, *lists, count)
            seconds, rows = bench(WORK / "fmu.so", guid, *arguments, stdin=moves.tobytes())
            return seconds / count / len(moves), rows.reshape(len(moves), -1)

        def by_fmu_run(count: int, threads: int, moves: np.ndarray, one_call: bool) -> tuple[float, np.ndarray]:
            wrists = fmu.instances(count, threads=threads)
            rows, last = np.empty((count, len(OUTPUTS))), np.empty((len(moves), len(OUTPUTS)))
            begin = time.perf_counter()
            for k, move in enumerate(moves):
                if one_call:
                    wrists.advance(MOTORS, move, STEP, OUTPUTS, rows)
                    continue
                wrists.set(MOTORS, move)
                wrists.get(OUTPUTS, rows)
                last[k] = rows[-1]
                wrists.step(STEP)
            return (time.perf_counter() - begin) / count / len(moves), last

        rows = []
        for count, number in SIZES:
            angle = 0.1 * np.sin(10 * np.pi * STEP * np.arange(number))
            moves = np.column_stack([angle, -angle])
            np.testing.assert_array_equal(by_fmu_run(count, 1, moves, False)[1], in_c(count, moves)[1])
            c, three = least(in_c, count, moves), least(by_fmu_run, count, 1, moves, False)
            one, two = (least(by_fmu_run, count, threads, moves, True) for threads in (1, 2))
            rows.append((f"{count:,}", three / c, one / c, one / two))
        table("instances", ("testbeds", "three calls / C", "one call / C", "two threads, throughput"), *rows)


def loops() -> None:
    """Compares closed loops in fmu_run with other masters."""
    system = read(FMUS / "prw_closed_loop.ssp", FMUS / "prw_closed_loop")
    # libcosim rounds communication points to nanoseconds.
    instants = np.arange(system.steps + 1) * round(system.step * 1e9) / 1e9
    with fmu_run.System(FMUS / "prw_closed_loop.ssp", order="jacobi") as loop:
        gains = {"controller.pitch_ref": np.full(LOOPS, system.inputs["pitch_ref"][1])}

        def ours(threads: int) -> tuple[float, fmu_run.Runs]:
            begin = time.perf_counter()
            kept: dict[str, Any] = {"outputs": ["pitch"], "measures": ["end"]}
            runs = loop.run(instants, start=gains, threads=threads, **kept).check()
            return (time.perf_counter() - begin) / LOOPS, runs

        rows = [(f"fmu_run, {threads} thread{'s' * (threads > 1)}", 1 / least(ours, threads)) for threads in (1, 2)]
        series = loop.run(instants, outputs=masters.RECORDED)
    for master in masters.MASTERS[:2]:
        if master.version() is None:
            continue
        rounds = []
        for _ in range(1 if QUICK else 3):
            begin = time.perf_counter()
            found = master.run(system)
            rounds.append(time.perf_counter() - begin)
        rows.append((f"{master.name} {master.version()}", 1 / min(rounds)))
        if master.name == "libcosim":
            expected = np.column_stack([series[name][0, 1:] for name in masters.RECORDED])
            np.testing.assert_array_equal(found, expected)
    table("loops", (f"closed loop, {system.steps} steps", "runs per second"), *rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("fmu", type=Path)
    parser.add_argument("--sources", type=Path, help="the FMU as C sources")
    options = parser.parse_args()
    guid = prepare(options.fmu)
    steps(guid, options.sources)
    many_runs()
    exchange()
    instances(guid)
    loops()
    write_figures()
    if not QUICK:
        subprocess.run(["cargo", "bench", "--locked", "--bench", "parts"], cwd=ROOT, check=True)


if __name__ == "__main__":
    main()
