"""Runs all checks of a release candidate and writes a table of the results; `make check-release`.

Each part is a target of the Makefile. A part that fails does not stop the others. The table is printed at the end and
written to out/release-check.md; each part's output is in out/release-check/.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
#: Names of the checks, each with a target of the Makefile and its variables.
PARTS = {
    "tests": ("test",),
    "long tests": ("test-long",),
    "Windows": ("check-windows",),
    "seeded faults": ("test-faults",),
    "newest FMPy": ("test-newest-fmpy",),
    "page in browsers": ("test-page",),
    "C sources": ("test-source-fmu",),
    "C sources on bare metal": ("test-bare-metal",),
    "release and platforms": ("test-platforms",),
    "reproducible bytes": ("test-reproducible",),
    "sanitizers, Miri, valgrind": ("sanitize",),
    "fuzzing, 2 minutes": ("fuzz", "FUZZ_SECONDS=120"),
    "importers' validation": ("validation",),
    "benchmarks, small counts": ("bench", "BENCH_QUICK=1"),
    "instructions of uses": ("instructions",),
    "identification, 10 rigs": ("monte-carlo", "RIGS=10", "FAULTY=1", "REAL=1", "FIGURE=out/detection.svg"),
    "figures": ("figures",),
    "documentation": ("docs",),
    "experiments": ("experiments",),
}


def changed() -> str:
    """The files that git sees as changed."""
    command = ["git", "status", "--short"]
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def run(name: str, arguments: tuple[str, ...], logs: Path) -> tuple[str, float]:
    """The result of one part and the minutes that it took."""
    begin, before = time.monotonic(), changed()
    log = logs / f"{arguments[0]}.log"
    print(f"== {name}: make {' '.join(arguments)} > {log.relative_to(ROOT)}", flush=True)
    # The targets start make again, which must not inherit the flags of this make, nor ARGS, which names the parts.
    inherited = ("ARGS", "MAKEFLAGS", "MAKELEVEL", "MAKEOVERRIDES", "MFLAGS")
    environment = {key: value for key, value in os.environ.items() if key not in inherited}
    with log.open("w", encoding="utf-8") as file:
        command = ["make", "--no-print-directory", *arguments]
        done = subprocess.run(command, cwd=ROOT, env=environment, stdout=file, stderr=subprocess.STDOUT, check=False)
    minutes = (time.monotonic() - begin) / 60
    if done.returncode:
        return f"failed with status {done.returncode}", minutes
    return "passed" if changed() == before else "changed files that git tracks", minutes


def main() -> int:
    """Run all parts, or the parts with the named targets."""
    targets = [arguments[0] for arguments in PARTS.values()]
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"parts to run: {', '.join(targets)}")
    options = parser.parse_args()
    if unknown := set(options.targets) - set(targets):
        parser.error(f"no part has the target {', '.join(sorted(unknown))}; choose from {', '.join(targets)}")
    logs = ROOT / "out/release-check"
    logs.mkdir(parents=True, exist_ok=True)
    lines = ["| part | result | minutes |", "|---|---|---|"]
    results = []
    for name, arguments in PARTS.items():
        if not options.targets or arguments[0] in options.targets:
            result, minutes = run(name, arguments, logs)
            results.append(result)
            lines.append(f"| {name} | {result} | {minutes:.1f} |")
            print(lines[-1], flush=True)
    (ROOT / "out/release-check.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(["", *lines]))
    return 0 if all(result == "passed" for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
