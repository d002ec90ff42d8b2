"""The platforms of the FMU: Rust targets, and directories in the FMU."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

#: The packages whose libraries go into FMUs. The name of a package is also the modelIdentifier of its FMU.
MODEL = "prw_testbed"
CONTROLLER = "prw_controller"
MODELS = (MODEL, CONTROLLER)
#: The program that packs the FMUs of a model, and the package of the program.
PACKERS = {MODEL: ("build_fmu", "build_fmu"), CONTROLLER: ("build_fmu_controller", CONTROLLER)}

#: The glibc of Enterprise Linux 7, the oldest supported system.
GLIBC = "2.17"


@dataclass(frozen=True)
class Target:
    """A Rust target and the file names of its libraries."""

    triple: str
    suffix: str
    #: The oldest macOS that the library runs on.
    macos: str = ""

    def library(self, model: str) -> str:
        """Returns the file name of the library of a model."""
        return f"{'' if 'windows' in self.triple else 'lib'}{model}{self.suffix}"

    @property
    def processor(self) -> str:
        """The processor in the name of the target."""
        return self.triple.split("-")[0]

    @property
    def wheel(self) -> str:
        """The platform tag in the file name of a wheel."""
        processor = self.processor
        if self.macos:
            return f"macosx_{self.macos.replace('.', '_')}_{'arm64' if processor == 'aarch64' else processor}"
        return "win_amd64" if "windows" in self.triple else f"manylinux_{GLIBC.replace('.', '_')}_{processor}"


LINUX = Target("x86_64-unknown-linux-gnu", ".so")
LINUX_ARM = Target("aarch64-unknown-linux-gnu", ".so")
WINDOWS = Target("x86_64-pc-windows-gnu", ".dll")
MAC = Target("x86_64-apple-darwin", ".dylib", macos="10.12")
MAC_ARM = Target("aarch64-apple-darwin", ".dylib", macos="11.0")

#: Targets that `make release` compiles.
TARGETS = (LINUX, LINUX_ARM, WINDOWS, MAC, MAC_ARM)

#: Target that is translated to C, for all other platforms.
WEBASSEMBLY = Target("wasm32-unknown-unknown", ".wasm")

#: The directories of `binaries/` in FMI 2.0 and the targets of their libraries; two targets make a universal library.
#: The names for ARM are the same in FMI 2.0.5 and FMI 3.0. darwin64 contains ARM as well, because importers on ARM Macs
#: look there.
DIRECTORIES = {
    "linux64": (LINUX,),
    "win64": (WINDOWS,),
    "darwin64": (MAC, MAC_ARM),
    "aarch64-linux": (LINUX_ARM,),
    "aarch64-darwin": (MAC_ARM,),
}

#: With FMI 2.0, some importers on ARM Linux look in linux64, where the FMU for Intel and ARM has the Intel library. For
#: them, a separate FMU has the ARM library in linux64.
ARM_DIRECTORIES = {"linux64": (LINUX_ARM,)}

#: FMI 3.0 has a directory for each target.
FMI3_DIRECTORIES = {
    "x86_64-linux": (LINUX,),
    "aarch64-linux": (LINUX_ARM,),
    "x86_64-windows": (WINDOWS,),
    "x86_64-darwin": (MAC,),
    "aarch64-darwin": (MAC_ARM,),
}
