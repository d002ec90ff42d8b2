"""The compilers, and fixtures: the C sources in the source FMU, and the environment of compiled programs."""

from __future__ import annotations

import shutil
import subprocess
import sys
import zipfile
from dataclasses import dataclass
from pathlib import Path

import fmpy
import pytest
import toolchain
from built import ROOT

FMU = ROOT / "target" / "fmu" / "prw_testbed.fmu"
SOURCE_FMU = ROOT / "target" / "fmu" / "source" / "prw_testbed.fmu"
CONTROLLER = SOURCE_FMU.with_name("prw_controller.fmu")
HEADERS = Path(fmpy.__file__).parent / "c-code"


OUTPUTS = ("tau1", "tau2", "pitch", "roll")


@dataclass(frozen=True)
class Compiler:
    """A C compiler. `start` begins the command that runs its programs here; it is None if they cannot run here."""

    command: tuple[str, ...]
    start: tuple[str, ...] | None = ()

    def programs(self) -> list[str]:
        """Returns the programs that must be installed."""
        return [self.command[0], *(self.start or ())[:1]]

    def require(self) -> None:
        """Skips the test if a program is missing."""
        for program in self.programs():
            if not shutil.which(program):
                pytest.skip(f"{program} is missing; on Debian: apt install {toolchain.PACKAGES[program]}")

    def compile(self, sources: Path, output: Path, *arguments: str, check: bool = True) -> str:
        """Compiles the sources and returns the compiler's messages."""
        command = [*self.command, *arguments, f"-I{HEADERS}", f"-I{sources}", "-o", str(output)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert not check or done.returncode == 0, done.stderr
        return done.stderr


COMPILERS = {
    "gcc": Compiler(("gcc",)),
    "clang": Compiler(("clang",)),
    "mingw": Compiler(("x86_64-w64-mingw32-gcc", "-static"), (toolchain.WINE,)),
    "aarch64": Compiler(("aarch64-linux-gnu-gcc", "-static"), ("qemu-aarch64",)),
    "clang for aarch64": Compiler(("clang", "--target=aarch64-linux-gnu", "-static"), ("qemu-aarch64",)),
    "riscv64": Compiler(("riscv64-linux-gnu-gcc", "-static"), ("qemu-riscv64",)),
    "armhf": Compiler(("arm-linux-gnueabihf-gcc", "-static"), ("qemu-arm",)),
}


def pytest_configure(config: pytest.Config) -> None:
    """Installs the compilers if possible; otherwise names them, and their tests are skipped. The small tests need only gcc."""
    if config.option.markexpr == "small":
        return
    programs = [program for name in COMPILERS if name != "gcc" for program in COMPILERS[name].programs()]
    try:
        toolchain.need(*programs)
    except SystemExit as missing:
        print(missing, file=sys.stderr)


def unpack(fmu: Path, directory: Path) -> Path:
    """Unpacks the FMU and returns its directory `sources`."""
    if not fmu.is_file():
        pytest.exit(f"{fmu} is missing; build it with `make test-source-fmu`", returncode=1)
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(directory)
    return directory / "sources"


def references(description: fmpy.model_description.ModelDescription) -> list[int]:
    """Returns the value references of the motor angles and the outputs."""
    by_name = {variable.name: variable.valueReference for variable in description.modelVariables}
    return [by_name[name] for name in ("theta1", "theta2", *OUTPUTS)]


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory `sources` of the FMU."""
    return unpack(SOURCE_FMU, tmp_path_factory.mktemp("fmu"))


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """The environment variables for the programs, some of which run under Wine."""
    return toolchain.windows(tmp_path_factory.mktemp("wine"))
