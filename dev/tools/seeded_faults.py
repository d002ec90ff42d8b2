"""Puts faults into the sources, one at a time, and runs the tests with each. A fault that no test finds has escaped.

    python dev/tools/seeded_faults.py [--only TEXT] [--check] [LIST.toml ...]

The lists are in tests/faults. The faults go into a copy of the sources in target/faults. Run all lists before and after
tests are deleted or merged. The faults of fmu-check's tests are in crates/fmu-test-kit/models and run with `make test`.
The exit status is 1 if a fault escaped, or if the tests fail without a fault.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import fmpy

ROOT = Path(__file__).resolve().parents[2]
LISTS = ROOT / "tests/faults"
SOURCE_COPY = ROOT / "target/faults/sources"
#: Seconds that compiling and one set of tests may take. A fault may make a test hang.
TIMEOUT = 600


@dataclass(frozen=True)
class Fault:
    """A replacement in a file, and the arguments of `cargo test` that should fail with it."""

    name: str
    file: Path
    old: str
    new: str
    tests: tuple[str, ...]

    def apply_to(self, text: str) -> str:
        """Return the content of the file with the fault."""
        if text.count(self.old) != 1:
            raise ValueError(f"{self.file}: the text to replace occurs {text.count(self.old)} times: {self.name}")
        return text.replace(self.old, self.new)


def read(path: Path) -> list[Fault]:
    """The faults of a list."""
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    directory = Path(content["directory"])
    return [
        Fault(
            fault["name"],
            directory / fault["file"],
            fault["old"],
            fault["new"],
            tuple(fault.get("tests", content["tests"])),
        )
        for fault in content["fault"]
    ]


def copy_sources() -> None:
    """Makes SOURCE_COPY equal to the files that git tracks. Unchanged files keep their modification times, so that
    cargo does not compile them again."""
    command = ["git", "ls-files", "-z"]
    names = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout.split("\0")
    for path in [
        path for path in SOURCE_COPY.rglob("*") if path.is_file() and str(path.relative_to(SOURCE_COPY)) not in names
    ]:
        path.unlink()
    for name in filter(None, names):
        source, target = ROOT / name, SOURCE_COPY / name
        if source.is_file() and not (target.is_file() and target.read_bytes() == source.read_bytes()):
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)


class StaleError(Exception):
    """The sources with a fault do not compile; the text is the compiler's."""


def tests_fail(arguments: str) -> bool:
    """Whether `cargo test` with these arguments fails in the copy, or takes longer than TIMEOUT."""
    # FMPy, which is installed with this interpreter, brings the headers of the C programs.
    headers = Path(fmpy.__file__).parent / "c-code"
    command = ["cargo", "test", "--locked", "--quiet", *arguments.split()]
    # In a separate session, the tests that cargo has started are killed with it.
    with subprocess.Popen(
        command,
        cwd=SOURCE_COPY,
        env={**os.environ, "FMI2_HEADERS": str(headers), "CARGO_TARGET_DIR": str(SOURCE_COPY.parent / "target")},
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            _, errors = process.communicate(timeout=TIMEOUT)
        except subprocess.TimeoutExpired:
            return True
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    if "could not compile" in errors:
        raise StaleError(errors)
    return process.returncode != 0


def survives(fault: Fault) -> bool:
    """Whether all tests pass with the fault."""
    path = SOURCE_COPY / fault.file
    text = path.read_text(encoding="utf-8")
    path.write_text(fault.apply_to(text), encoding="utf-8")
    try:
        return not any(tests_fail(arguments) for arguments in fault.tests)
    finally:
        path.write_text(text, encoding="utf-8")


def main() -> int:
    """Run the lists, or check that their faults fit the sources."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("lists", nargs="*", type=Path, metavar="LIST.toml", default=sorted(LISTS.glob("*.toml")))
    parser.add_argument("--only", default="", metavar="TEXT", help="the faults whose names contain the text")
    parser.add_argument("--check", action="store_true", help="only check that each fault fits the sources")
    options = parser.parse_args()
    faults = [fault for path in options.lists for fault in read(path) if options.only in fault.name]
    if not faults:
        parser.error(f"no name of a fault contains {options.only!r}")
    for fault in faults:
        fault.apply_to((ROOT / fault.file).read_text(encoding="utf-8"))
    if options.check:
        print(f"{len(faults)} faults fit the sources")
        return 0
    copy_sources()
    for arguments in dict.fromkeys(arguments for fault in faults for arguments in fault.tests):
        if tests_fail(arguments):
            print(f"cargo test {arguments} fails without a fault", file=sys.stderr)
            return 1
    found = 0
    for fault in faults:
        try:
            outcome = "escaped" if survives(fault) else "found"
        except StaleError as error:
            outcome = "stale"
            print(f"the sources with the next fault do not compile:\n{error}", file=sys.stderr)
        found += outcome == "found"
        print(f"{outcome:<7}  {fault.name}", flush=True)
    print(f"{found} of {len(faults)} faults found")
    return 0 if found == len(faults) else 1


if __name__ == "__main__":
    sys.exit(main())
