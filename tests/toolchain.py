"""Programs that tests start and that are not Python packages."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

#: The program of Debian's package wine64, which is not in a directory of PATH.
WINE = "/usr/lib/wine/wine64"
#: Programs and their Debian packages.
PACKAGES = {
    "gcc": "gcc libc6-dev",
    "x86_64-w64-mingw32-gcc": "gcc-mingw-w64-x86-64",
    "aarch64-linux-gnu-gcc": "gcc-aarch64-linux-gnu libc6-dev-arm64-cross",
    "qemu-aarch64": "qemu-user",
    "riscv64-linux-gnu-gcc": "gcc-riscv64-linux-gnu libc6-dev-riscv64-cross",
    "qemu-riscv64": "qemu-user",
    "arm-linux-gnueabihf-gcc": "gcc-arm-linux-gnueabihf libc6-dev-armhf-cross",
    "qemu-arm": "qemu-user",
    "arm-none-eabi-gcc": "gcc-arm-none-eabi libnewlib-arm-none-eabi",
    "qemu-system-arm": "qemu-system-arm",
    "clang": "clang",
    "chromium": "chromium",
    "firefox-esr": "firefox-esr",
    "xvfb-run": "xvfb xauth",
    "/usr/lib/x86_64-linux-gnu/webkit2gtk-4.1/MiniBrowser": "libwebkit2gtk-4.1-0",
    WINE: "wine64",
}


def windows(directory: Path) -> dict[str, str]:
    """Returns the environment of Windows programs under Wine: a separate Windows in a directory, without a display."""
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "PYTHONPATH")}
    settings = {"WINEDEBUG": "-all", "WINEARCH": "win64", "WINEDLLOVERRIDES": "mscoree,mshtml="}
    return {**environment, **settings, "WINEPREFIX": str(directory)}


def need(*programs: str) -> None:
    """Installs the Debian packages of missing programs. If that fails, exits and names the packages."""
    missing = " ".join(sorted({PACKAGES[program] for program in programs if not shutil.which(program)}))
    if missing:
        apt = f"apt-get update -qq && apt-get install -y -qq --no-install-recommends {missing}"
        root = [] if os.geteuid() == 0 else ["sudo", "-n"]
        if subprocess.run([*root, "sh", "-c", apt], env={**os.environ, "DEBIAN_FRONTEND": "noninteractive"}).returncode:
            raise SystemExit(f"error: programs are missing; on Debian, apt install {missing}")
