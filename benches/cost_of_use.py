"""What the FMU costs besides the step: python benches/cost_of_use.py FMU. Prints a Markdown table.

Times are ratios to one that every user of FMPy pays, Python's `import fmpy`; sizes are in kB. With BENCH_QUICK in the
environment each is measured once, and nothing is built.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable
from pathlib import Path

from fmpy import extract, read_model_description, simulate_fmu
from fmpy.fmi2 import FMU2Slave

ROOT = Path(__file__).parent.parent
QUICK = "BENCH_QUICK" in os.environ
ROUNDS = 1 if QUICK else 5


def shortest(work: Callable[[], object]) -> float:
    """The least of several wall times of `work`, s."""

    def once() -> float:
        begin = time.perf_counter()
        work()
        return time.perf_counter() - begin

    return min(once() for _ in range(ROUNDS))


def command(*words: str) -> None:
    """Runs a command in the project's folder, quietly; its failure ends the benchmark."""
    subprocess.run(words, cwd=ROOT, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def load(fmu: Path) -> None:
    """What an importer does before the first step, and after the last."""
    with tempfile.TemporaryDirectory() as folder:
        extract(str(fmu), folder)
        description = read_model_description(folder)
        slave = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="cost",
        )
        slave.instantiate()
        slave.setupExperiment()
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slave.terminate()
        slave.freeInstance()


def simulate(fmu: Path) -> None:
    """2 s in steps of 1 ms, outputs recorded at every step."""
    simulate_fmu(str(fmu), stop_time=2.0, output_interval=1e-3)


def rebuild() -> None:
    """As after a change of the FMU's code."""
    os.utime(ROOT / "src" / "fmu.rs")
    command("make", "fmu")


def main() -> None:
    fmu = Path(sys.argv[1]).resolve()
    with zipfile.ZipFile(fmu) as archive:
        libraries = {entry.filename: entry.file_size for entry in archive.infolist() if "binaries/" in entry.filename}
    imported = shortest(lambda: command(sys.executable, "-c", "import fmpy"))
    rows: dict[str, Callable[[], object]] = {
        "FMPy: unpack, read, load, instantiate, initialize, free": lambda: load(fmu),
        "FMPy's simulate_fmu: the same and 2,000 steps, all outputs recorded": lambda: simulate(fmu),
    }
    if not QUICK:
        rows["`make demo`, everything built"] = lambda: command("make", "demo")
        rows["`make fmu` after a change of src/fmu.rs"] = rebuild
    print("| what | in times of `import fmpy` |\n|---|---|")
    for what, work in rows.items():
        print(f"| {what} | {shortest(work) / imported:.2f} |")
    print("\n| what | kB |\n|---|---|")
    for name, size in libraries.items():
        print(f"| {name} | {size / 1e3:.0f} |")
    print(f"| {fmu.name} | {fmu.stat().st_size / 1e3:.0f} |")


if __name__ == "__main__":
    main()
