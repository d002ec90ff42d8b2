"""Fixtures: the FMUs of C sources, unpacked, and compilers for them."""

from __future__ import annotations

import os
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

#: Debian's package wine64 alone has it only there.
WINE = "/usr/lib/wine/wine64"


@dataclass(frozen=True)
class Compiler:
    """A C compiler, and what starts the programs it makes, if anything here does."""

    command: tuple[str, ...]
    start: tuple[str, ...] | None = ()

    def programs(self) -> list[str]:
        """What has to be installed."""
        return [self.command[0], *(self.start or ())[:1]]

    def require(self) -> None:
        """Skips the test where it is missing."""
        for program in self.programs():
            if not shutil.which(program):
                pytest.skip(f"{program} is missing; on Debian: apt install {toolchain.PACKAGES[program]}")

    def compile(self, sources: Path, output: Path, *arguments: str, check: bool = True) -> str:
        """Compiles; the compiler's messages."""
        command = [*self.command, *arguments, f"-I{HEADERS}", f"-I{sources}", "-o", str(output)]
        done = subprocess.run(command, capture_output=True, text=True)
        assert not check or done.returncode == 0, done.stderr
        return done.stderr


COMPILERS = {
    "gcc": Compiler(("gcc",)),
    "clang": Compiler(("clang",)),
    "mingw": Compiler(("x86_64-w64-mingw32-gcc", "-static"), (WINE,)),
    "aarch64": Compiler(("aarch64-linux-gnu-gcc", "-static"), ("qemu-aarch64",)),
    "clang for aarch64": Compiler(("clang", "--target=aarch64-linux-gnu", "-static"), ("qemu-aarch64",)),
    "armhf": Compiler(("arm-linux-gnueabihf-gcc", "-static"), ("qemu-arm",)),
}


def pytest_configure() -> None:
    """Installs the compilers where that is possible, else names them: their tests are skipped then."""
    programs = [program for name in COMPILERS if name != "gcc" for program in COMPILERS[name].programs()]
    try:
        toolchain.need(*programs)
    except SystemExit as missing:
        print(missing, file=sys.stderr)


def unpack(fmu: Path, folder: Path) -> Path:
    """Unpacks the FMU; the folder `sources`."""
    if not fmu.is_file():
        pytest.exit(f"{fmu} is missing; build it with `make test-source-fmu`", returncode=1)
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    return folder / "sources"


@pytest.fixture(scope="session")
def sources(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder `sources` of the FMU."""
    return unpack(SOURCE_FMU, tmp_path_factory.mktemp("fmu"))


@pytest.fixture(scope="session")
def environment(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """For the programs, of which some run under Wine: a Windows of their own, without windows."""
    wine = {"WINEPREFIX": str(tmp_path_factory.mktemp("wine")), "WINEDEBUG": "-all", "WINEARCH": "win64"}
    wine["WINEDLLOVERRIDES"] = "mscoree,mshtml="
    return {name: value for name, value in os.environ.items() if name != "DISPLAY"} | wine
