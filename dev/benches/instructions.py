"""Counts the instructions of about 25 typical uses of the FMU and of fmu-run with callgrind; `make instructions`.

Counts of instructions do not depend on the load of a machine, so a test compares them with the committed table
instructions.json. They depend on the compiler, so the table names its version.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

import fmpy

ROOT = Path(__file__).resolve().parents[2]
TABLE = Path(__file__).with_name("instructions.json")
#: Relative difference from the table that is tolerated, because a change elsewhere may change decisions of the
#: compiler.
TOLERANCE = 0.03
#: Uses in crates/fmu-run/examples/count_runs.rs: the name in the table, the repetitions, and the units (such as steps)
#: in each.
RUNS = {
    "load": ("fmu-run: open the FMU", 1, 1),
    "one step": ("fmu-run: a run of one step", 200, 1),
    "outputs": ("fmu-run: a step in a batch on np.arange(n) * 1e-3, outputs stored", 100, 200),
    "statistics": ("fmu-run: a step in a batch on np.arange(n) * 1e-3, statistics", 100, 200),
    "instances": ("fmu-run: an instance of 64, set, step and get in one call", 20, 64),
}


def compiler() -> str:
    """The version of rustc, on which the counts depend."""
    return subprocess.run(["rustc", "--version"], check=True, capture_output=True, text=True).stdout.strip()


def why_not_measurable() -> str | None:
    """Returns why the counts cannot be compared with the table here, or None."""
    if shutil.which("valgrind") is None:
        return "valgrind is missing; on Debian: apt install valgrind"
    if not Path("/usr/include/valgrind/callgrind.h").is_file():
        return "the headers of valgrind are missing"
    counted = json.loads(TABLE.read_text(encoding="utf-8"))["compiler"]
    return None if counted == compiler() else f"the table was counted with {counted}, this is {compiler()}"


def callgrind(file: Path, *command: object, options: tuple[str, ...] = ()) -> list[str]:
    """Runs a program under callgrind, and returns the lines of its output."""
    words = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={file}", *options, *map(str, command)]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"error: {' '.join(words)}: {done.stderr}")
    return done.stdout.splitlines()


def total(file: Path) -> int:
    """The instructions in a file of callgrind."""
    (found,) = re.findall(r"^totals: (\d+)", file.read_text(encoding="utf-8"), re.MULTILINE)
    return int(found)


def of_steps(library: Path, guid: str, directory: Path) -> dict[str, float]:
    """Instructions per repetition of the uses in uses.c, by their names."""
    program, file = directory / "uses", directory / "steps"
    headers = Path(fmpy.__file__).parent / "c-code"
    source = ROOT / "dev" / "benches" / "c" / "uses.c"
    strict = ("-O2", "-Wall", "-Wextra", "-Werror")
    subprocess.run(["cc", *strict, "-I", headers, "-o", program, source, "-ldl", "-lm"], check=True)
    lines = callgrind(file, program, library, guid, options=("--collect-atstart=no",))
    counts = {}
    for number, line in enumerate(lines, start=1):
        repetitions, use = line.split(" ", 1)
        counts[use] = total(directory / f"steps.{number}") / int(repetitions)
    return counts


def of_runs(fmu: Path, directory: Path) -> dict[str, float]:
    """Instructions per unit of the uses in count_runs.rs, from the difference between many repetitions and one."""
    cargo = ("cargo", "build", "--locked", "--quiet", "--release", "--package", "fmu-run", "--example", "count_runs")
    subprocess.run(cargo, cwd=ROOT, check=True)
    program = ROOT / "target" / "release" / "examples" / "count_runs"

    def count(use: str, repetitions: int) -> int:
        file = directory / f"{use.replace(' ', '-')}-{repetitions}"
        callgrind(file, program, fmu, use, repetitions)
        return total(file)

    return {label: (count(use, 1 + more) - count(use, 1)) / more / units for use, (label, more, units) in RUNS.items()}


def measure(fmu: Path, with_runs: bool = True) -> dict[str, int]:
    """Counts the instructions of every use, by its name. The uses of fmu-run need a release build, which takes longer than the rest."""
    with tempfile.TemporaryDirectory() as scratch:
        directory = Path(scratch)
        with zipfile.ZipFile(fmu) as archive:
            library = Path(archive.extract("binaries/linux64/prw_testbed.so", directory))
        guid = fmpy.read_model_description(str(fmu)).guid
        counts = of_steps(library, guid, directory)
        if with_runs:
            counts |= of_runs(fmu, directory)
    return {use: round(found) for use, found in counts.items()}


def differences(counts: dict[str, int], table: dict[str, int]) -> list[str]:
    """Returns a line for each use whose count left the tolerance of the table, or that only one of both contains."""
    found = [f"{use} is new in the measurement" for use in counts.keys() - table.keys()]
    found += [f"{use} is no longer measured" for use in table.keys() - counts.keys()]
    for use in counts.keys() & table.keys():
        change = counts[use] / table[use] - 1
        if abs(change) > TOLERANCE:
            found.append(f"{use}: {table[use]:,} -> {counts[use]:,} instructions ({change:+.1%})")
    return sorted(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("fmu", type=Path)
    parser.add_argument("--write", action="store_true", help="write the table")
    options = parser.parse_args()
    counts = measure(options.fmu)
    table = json.loads(TABLE.read_text(encoding="utf-8"))["instructions"] if TABLE.is_file() else {}
    for use, count in counts.items():
        print(f"{count:12,} {use}" + (f"  (before: {table[use]:,})" if table.get(use, count) != count else ""))
    if options.write:
        content = {"compiler": compiler(), "instructions": counts}
        TABLE.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
    elif changed := differences(counts, table):
        sys.exit("\n".join(["the instructions differ from dev/benches/instructions.json:", *changed]))


if __name__ == "__main__":
    main()
