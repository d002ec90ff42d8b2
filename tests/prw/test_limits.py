"""Limits of the machine and of the user's patience: the size of files, interrupts during the start, names that are not UTF-8."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from file_limits import run_limited

pytestmark = pytest.mark.skipif(os.name != "posix", reason="limits, signals and names of POSIX")

RECORDING = "time,theta1,theta2\n" + "".join(f"{k / 1000},{k / 7e6!r},{k / 3e6!r}\n" for k in range(3000))

#: Interrupts the process as soon as a module is imported.
INTERRUPT = """
import os, signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a background job
module = sys.argv[1]
class Interrupt:
    def find_spec(name, path=None, target=None):
        if name == module:
            os.kill(os.getpid(), signal.SIGINT)
            print("the import continues", flush=True)
sys.meta_path.insert(0, Interrupt)
from prw.__main__ import main
sys.argv[:2] = ["prw"]
sys.exit(main())
"""


@pytest.mark.parametrize("module", ["prw.cli", "argparse", "prw.commands.simulate", "fmu_run", "numpy"])
def test_an_interrupt_during_an_import(tmp_path: Path, fmu: Path, module: str) -> None:
    """Imports take most of the time of a short command. They end first, because compiled modules may crash if an exception is raised while
    they are initialized."""
    command = [sys.executable, "-c", INTERRUPT, module, "simulate", "--fmu", str(fmu)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 130 and done.stderr in ("\nprw: interrupted\n", "\nprw simulate: interrupted\n"), (
        done.stderr
    )
    assert "the import continues" in done.stdout


def test_only_two_short_modules_precede_the_handling_of_interrupts() -> None:
    """An interrupt during their imports shows a traceback."""
    code = "import sys; known = set(sys.modules); import prw.__main__; print(*sorted(set(sys.modules) - known))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "prw prw.__main__\n"


@pytest.mark.parametrize(
    ("limit", "message"), [(0, "cannot be unpacked"), (10_000, "cannot be unpacked"), (300_000, "cannot be")]
)
def test_files_that_exceed_the_limit(tmp_path: Path, fmu: Path, limit: int, message: str) -> None:
    """The message is one line, and neither the directory for results nor the one for temporary files has a part of a file."""
    recording = tmp_path / "motors.csv"
    recording.write_text(RECORDING)
    command = [sys.executable, "-m", "prw", "simulate", str(recording), "--fmu", str(fmu), "--out", "out"]
    done = run_limited(command, tmp_path, limit)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1), done.stderr
    assert message in done.stderr and "File too large" in done.stderr
    assert not list(tmp_path.glob("out/*")) and not list(tmp_path.glob("temporary/*"))


def test_names_that_are_not_utf8(tmp_path: Path, fmu: Path) -> None:
    directory = os.fsencode(tmp_path) + b"/caf\xe9"
    os.mkdir(directory)
    recording, copy, out = (directory + name for name in (b"/m\xff.csv", b"/f\xff.fmu", b"/out"))
    Path(os.fsdecode(recording)).write_text(RECORDING)
    Path(os.fsdecode(copy)).write_bytes(fmu.read_bytes())
    command = [os.fsencode(sys.executable), b"-m", b"prw", b"simulate", recording, b"--fmu", copy, b"--out", out]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert b"m\xff.csv" in os.listdir(out)
