"""Many runs of an FMU from Python, beside a bare loop in C and beside FMPy: python benches/many_runs.py.

Prints a Markdown table of ratios, measured in turn; each is the least of several rounds. All three store the same outputs at
every step, and these must agree to 1e-12. With BENCH_QUICK in the environment counts are small: the table is then meaningless.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from ctypes import c_double, c_uint32
from pathlib import Path
from typing import Any

import fmpy
import fmu_run
import numpy as np
from fmpy.simulation import instantiate_fmu

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "fmu_run"))
from unruly import build  # noqa: E402

STEP = 1e-3
SAMPLES, RUNS, ROUNDS = (21, 4, 1) if "BENCH_QUICK" in os.environ else (2001, 2000, 7)
TIME = np.arange(SAMPLES) * STEP


class Case:
    """An FMU with a course for its inputs (samples, n) and names of its outputs."""

    def __init__(
        self, name: str, fmu: Path, inputs: dict[str, np.ndarray], outputs: list[str], folder: Path, runs: int
    ):
        self.name, self.fmu, self.inputs, self.outputs, self.runs = name, fmu, inputs, outputs, runs
        self.folder = folder / name
        self.description = fmpy.read_model_description(str(fmu))
        fmpy.extract(str(fmu), unzipdir=str(self.folder))
        of = {v.name: v.valueReference for v in self.description.modelVariables}
        self.references = [of[name] for name in inputs], [of[name] for name in outputs]
        self.table = np.ascontiguousarray(np.column_stack(list(inputs.values())))
        self.slave = instantiate_fmu(str(self.folder), self.description, fmi_type="CoSimulation")
        self.loaded = fmu_run.Fmu(fmu)
        # One start value for each run makes as many runs.
        self.start = {next(iter(inputs)): np.full(runs, self.table[0, 0])}

    def close(self) -> None:
        self.slave.freeInstance()
        self.loaded.close()

    def in_c(self) -> tuple[float, np.ndarray]:
        """Seconds of all runs in C, and the outputs (samples, n) of the last."""
        identifier = self.description.coSimulation.modelIdentifier
        library = self.folder / "binaries" / "linux64" / f"{identifier}.so"
        lists = (",".join(map(str, references)) for references in self.references)
        command = [ROOT / "target/bench/loop", library, self.description.guid, self.runs, SAMPLES, STEP, *lists, 1]
        done = subprocess.run(
            [str(word) for word in command], input=self.table.tobytes(), capture_output=True, check=True
        )
        return float(done.stderr), np.frombuffer(done.stdout).reshape(SAMPLES, -1)

    def by_fmu_run(self, threads: int, **kept: Any) -> tuple[float, fmu_run.Runs]:
        begin = time.perf_counter()
        runs = self.loaded.run(
            TIME, inputs=self.inputs, start=self.start, outputs=self.outputs, threads=threads, **kept
        )
        return time.perf_counter() - begin, runs.check()

    def by_fmpy(self) -> tuple[float, np.ndarray]:
        """Seconds of one run by FMPy's bare calls, reading and writing rows of arrays in place, and its outputs."""
        slave, component = self.slave, self.slave.component
        (n_in, n_out), table = map(len, self.references), np.empty((SAMPLES, len(self.outputs)))
        into, out_of = ((c_uint32 * len(vr))(*vr) for vr in self.references)
        in_row, out_row, inputs, instants = c_double * n_in, c_double * n_out, self.table, TIME.tolist()
        begin = time.perf_counter()
        slave.reset()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        for k, t in enumerate(instants):
            slave.fmi2SetReal(component, into, n_in, in_row.from_buffer(inputs, k * inputs.strides[0]))  # type: ignore[arg-type]
            slave.fmi2GetReal(component, out_of, n_out, out_row.from_buffer(table, k * table.strides[0]))  # type: ignore[arg-type]
            if k + 1 < SAMPLES:
                slave.fmi2DoStep(component, t, STEP, True)
        slave.terminate()
        return time.perf_counter() - begin, table


def cases(folder: Path) -> list[Case]:
    wave = 2 * np.sin(10 * np.pi * TIME / 2) ** 2 / (10 * np.pi)
    motors = {"theta1": wave, "theta2": -wave}
    wrist = {"pitch_ref": 3 * wave, "roll_ref": -2 * wave, "pitch": 2 * wave, "roll": -wave}
    fmus = ROOT / "target" / "fmu"
    return [
        Case("testbed", fmus / "prw_testbed.fmu", motors, ["tau1", "pitch", "roll", "roll_rate"], folder, RUNS),
        Case("controller", fmus / "prw_controller.fmu", wrist, ["theta1", "theta2", "omega1", "omega2"], folder, RUNS),
        Case("a ramp in C", build(folder, "-DCOMPLETE"), {"slope": 1 + wave}, ["y"], folder, 2 * RUNS),
    ]


def row(case: Case) -> str:
    least = dict.fromkeys(("c", "one", "two", "measures", "fmpy"), np.inf)
    for _ in range(ROUNDS):
        in_c, expected = case.in_c()
        one, runs = case.by_fmu_run(1)
        two, _ = case.by_fmu_run(2)
        measures, _ = case.by_fmu_run(1, measures=["peak", "rms", "end"])
        fmpy_, table = case.by_fmpy()
        for number, name in enumerate(case.outputs):
            for found in (runs[name][-1], table[:, number]):
                np.testing.assert_allclose(found, expected[:, number], rtol=0, atol=1e-12)
        seconds = (in_c / case.runs, one / case.runs, two / case.runs, measures / case.runs, fmpy_)
        least = {name: min(least[name], found) for name, found in zip(least, seconds)}
    figures = (
        least["one"] / least["c"],
        least["measures"] / least["c"],
        least["one"] / least["two"],
        least["fmpy"] / least["one"],
        least["fmpy"] / least["two"],
    )
    return f"| {case.name} | " + " | ".join(f"{figure:.3g}" for figure in figures) + " |"


def main() -> None:
    print(
        "| FMU | one thread / C, outputs stored | one thread / C, measures | two threads, throughput | FMPy / one thread | FMPy / two |"
    )
    print("|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for case in cases(Path(folder)):
            print(row(case), flush=True)
            case.close()
            shutil.rmtree(case.folder)


if __name__ == "__main__":
    main()
