"""What compiling for other platforms needs: installed where that is possible, else named."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import sysconfig
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from targets import ROOT, WEBASSEMBLY, Target

#: The program of a Debian package.
PACKAGES = {
    "x86_64-w64-mingw32-gcc": ["gcc-mingw-w64-x86-64"],
    "aarch64-linux-gnu-gcc": ["gcc-aarch64-linux-gnu", "libc6-dev-arm64-cross"],
    "qemu-aarch64": ["qemu-user"],
    "arm-linux-gnueabihf-gcc": ["gcc-arm-linux-gnueabihf", "libc6-dev-armhf-cross"],
    "qemu-arm": ["qemu-user"],
    "clang": ["clang"],
    "chromium": ["chromium"],
    "firefox-esr": ["firefox-esr"],
    "xvfb-run": ["xvfb", "xauth"],
    "/usr/lib/x86_64-linux-gnu/webkit2gtk-4.1/MiniBrowser": ["libwebkit2gtk-4.1-0"],
    "/usr/lib/wine/wine64": ["wine64"],
}


def say(text: str) -> None:
    """Progress, in order with what the started programs say."""
    print(text, file=sys.stderr, flush=True)


@dataclass(frozen=True)
class Toolchain:
    """The Rust compiler for a target: its version, and the environment and flags of cargo."""

    description: str
    environment: dict[str, str] = field(default_factory=dict)
    flags: tuple[str, ...] = ()

    @property
    def sysroot(self) -> Path:
        """Where its libraries and their sources are."""
        return Path(_output("rustc", "--print", "sysroot"))

    @property
    def commit(self) -> str:
        """The commit of the compiler, which std's own paths contain where its sources are not installed."""
        (commit,) = re.findall(r"^commit-hash: (\w+)$", _output("rustc", "-vV"), re.MULTILINE)
        return str(commit)


@cache
def toolchain(target: Target) -> Toolchain:
    """rustup's Rust. It compiles std too, without the code that prints backtraces: that is a third of a library, and
    importers print none. WebAssembly's std has no such code."""
    version = _output("rustc", "--version")
    if target is WEBASSEMBLY:
        if not any(Path(_output("rustc", "--print", "target-libdir", "--target", target.triple)).glob("libstd-*.rlib")):
            _rustup("target", "add", target.triple)
        return Toolchain(version)
    built = Toolchain(
        f"{version}, std compiled with it",
        # Cargo calls this unstable; compiler and sources are of one version.
        environment={"RUSTC_BOOTSTRAP": "1"},
        flags=("-Zbuild-std=std,panic_unwind", "-Zbuild-std-features=panic-unwind"),
    )
    if not (built.sysroot / "lib/rustlib/src/rust/library/Cargo.lock").exists():
        _rustup("component", "add", "rust-src")
    return built


def _rustup(*arguments: str) -> None:
    command = ["rustup", *arguments]
    say(" ".join(command))
    if not shutil.which("rustup") or subprocess.run(command, stdin=subprocess.DEVNULL).returncode:
        raise SystemExit(f"error: a release needs `{' '.join(command)}`; install Rust with rustup (https://rustup.rs)")


def need(*programs: str) -> None:
    """Installs what is missing of these programs."""
    missing = [package for program in programs if not shutil.which(program) for package in PACKAGES[program]]
    if missing:
        install(missing, ", ".join(programs))


def install(packages: list[str], purpose: str) -> None:
    """Installs Debian packages if this user may, else says which are missing and stops."""
    command = ["apt-get", "install", "-y", "-qq", "--no-install-recommends", *packages]
    root = [] if os.name != "posix" or os.geteuid() == 0 else ["sudo", "-n"]
    possible = shutil.which("apt-get") and (
        not root or (shutil.which("sudo") and subprocess.run([*root, "true"], capture_output=True).returncode == 0)
    )
    if not possible:
        raise SystemExit(f"error: missing for {purpose}: on Debian, apt install {' '.join(packages)}")
    say(f"installing {' '.join(packages)}")
    log = ROOT / "target" / "apt.log"
    log.parent.mkdir(exist_ok=True)
    with log.open("wb") as file:
        for arguments in (["apt-get", "update", "-qq"], command):
            environment = ["env", "DEBIAN_FRONTEND=noninteractive"]
            if subprocess.run([*root, *environment, *arguments], stdout=file, stderr=file).returncode:
                raise SystemExit(f"error: {' '.join(arguments)} failed; see {log}")


def zigbuild() -> str:
    """cargo's subcommand that links against an old glibc; from this environment (requirements/release.txt)."""
    path = shutil.which("cargo-zigbuild", path=sysconfig.get_path("scripts"))
    if not path:
        raise SystemExit("error: cargo-zigbuild is missing in this Python environment; start this with make release")
    return path


def rust_lld() -> str:
    """The linker that comes with rustup's Rust; it links for macOS anywhere."""
    sysroot = Path(_output("rustc", "--print", "sysroot"))
    for path in sorted(sysroot.glob("lib/rustlib/*/bin/rust-lld*")):
        return str(path)
    raise SystemExit(f"error: no rust-lld in {sysroot}, which links for macOS; install Rust with rustup")


def macos_sdk() -> Path:
    """As much of a macOS SDK as a Rust library links with: the list of functions in libSystem.

    The list comes with zig, made for the newest Macs; every function is there for all of them.
    """
    import ziglang

    text = (Path(ziglang.__file__).parent / "lib/libc/darwin/libSystem.tbd").read_text(encoding="utf-8")

    def for_all(match: re.Match[str]) -> str:
        names = [name.strip().replace("arm64e-", "arm64-") for name in match[2].split(",")]
        return f"{match[1]}[ {', '.join(dict.fromkeys(n for n in names if n.endswith('-macos') and '.x1' not in n))} ]"

    folder = ROOT / "target" / "macos-sdk" / "usr" / "lib"
    folder.mkdir(parents=True, exist_ok=True)
    text = re.sub(r"(targets:\s*)\[([^\]]*)\]", for_all, text)
    # What Rust names beside libSystem is part of it, or (iconv) not used.
    for name in ("System", "c", "m", "iconv"):
        (folder / f"lib{name}.tbd").write_text(text, encoding="utf-8")
    return folder.parents[1]


@cache
def _output(program: str, *arguments: str) -> str:
    try:
        return subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout.strip()
    except FileNotFoundError:
        raise SystemExit(f"error: {program} is missing; install Rust with rustup (https://rustup.rs)") from None
    except subprocess.CalledProcessError as error:
        raise SystemExit(f"error: {program} {' '.join(arguments)}: {error.stderr.strip()}") from None
