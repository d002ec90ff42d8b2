"""Fixtures: the FMU of C sources, unpacked, and compilers for it."""

from __future__ import annotations

import shutil
import subprocess
import zipfile
from dataclasses import dataclass
from pathlib import Path

import fmpy
import pytest

ROOT = Path(__file__).resolve().parents[2]
FMU = ROOT / "target" / "fmu" / "prw_testbed.fmu"
SOURCE_FMU = ROOT / "target" / "fmu" / "source" / "prw_testbed.fmu"
HEADERS = Path(fmpy.__file__).parent / "c-code"

#: A clang for many processors, which comes with what `make release` needs.
ZIG = (str(ROOT / ".venv-dist" / "bin" / "python"), "-m", "ziglang", "cc")
CLANG = ("clang",) if shutil.which("clang") else ZIG


@dataclass(frozen=True)
class Compiler:
    """A C compiler, and what starts the programs it makes, if anything here does."""

    command: tuple[str, ...]
    start: tuple[str, ...] | None = ()

    def require(self) -> None:
        """Skips the test where it is missing."""
        for program in (self.command[0], *(self.start or ())[:1]):
            if not shutil.which(program):
                pytest.skip(f"{program} is missing")

    def compile(self, sources: Path, output: Path, *arguments: str, check: bool = True) -> str:
        """Compiles; the compiler's messages."""
        command = [*self.command, *arguments, f"-I{HEADERS}", f"-I{sources}", "-o", str(output)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert not check or done.returncode == 0, done.stderr
        return done.stderr


COMPILERS = {
    "gcc": Compiler(("gcc",)),
    "clang": Compiler(CLANG),
    "mingw": Compiler(("x86_64-w64-mingw32-gcc", "-static"), None),
    "aarch64": Compiler(("aarch64-linux-gnu-gcc", "-static"), ("qemu-aarch64",)),
    "armhf": Compiler((*ZIG, "-target", "arm-linux-musleabihf", "-static"), ("qemu-arm",)),
}


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder `sources` of the FMU."""
    if not SOURCE_FMU.is_file():
        pytest.exit(f"{SOURCE_FMU} is missing; build it with `make source-fmu`", returncode=1)
    folder = tmp_path_factory.mktemp("fmu")
    with zipfile.ZipFile(SOURCE_FMU) as fmu:
        fmu.extractall(folder)
    return folder / "sources"
