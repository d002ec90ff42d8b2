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

#: Compiles std from Debian's sources even where rustup has it compiled.
BUILD_STD = bool(os.environ.get("BUILD_STD"))

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

DEBIAN_RUSTC = Path("/usr/bin/rustc")


def say(text: str) -> None:
    """Progress, in order with what the started programs say."""
    print(text, file=sys.stderr, flush=True)


@dataclass(frozen=True)
class Toolchain:
    """A Rust compiler that has, or can compile, the std of a target."""

    description: str
    rustc: str = "rustc"
    environment: dict[str, str] = field(default_factory=dict)
    flags: tuple[str, ...] = ()

    @property
    def sysroot(self) -> Path:
        """Where its libraries and their sources are."""
        return Path(_output(self.rustc, "--print", "sysroot"))


def toolchain(target: Target) -> Toolchain:
    """The toolchain for a target: rustup's, or else Debian's with std compiled from source."""
    compiled = not BUILD_STD or target is WEBASSEMBLY
    if compiled and (_has_std(target) or _rustup_adds(target)):
        return Toolchain(_output("rustc", "--version"))
    if target is WEBASSEMBLY:
        raise SystemExit(f"error: Rust's std for {target.triple} is missing: rustup target add {target.triple}")
    return _with_sources()


def _has_std(target: Target) -> bool:
    # Debian's rustc names a folder that does not exist, rustup's an empty one.
    folder = Path(_output("rustc", "--print", "target-libdir", "--target", target.triple))
    return any(folder.glob("libstd-*.rlib"))


def _rustup_adds(target: Target) -> bool:
    if not shutil.which("rustup"):
        return False
    say(f"rustup target add {target.triple}")
    return subprocess.run(["rustup", "target", "add", target.triple], stdin=subprocess.DEVNULL).returncode == 0


@cache
def _with_sources() -> Toolchain:
    sources = Path("lib/rustlib/src/rust/library/Cargo.lock")
    if not (DEBIAN_RUSTC.exists() and (DEBIAN_RUSTC.parents[1] / sources).exists()):
        say("rustup has no std for this target: compiling it with Debian's Rust")
        install(["rustc-web", "rust-web-src"], "std for another platform (or use rustup: rustup target add)")
    version = _output(str(DEBIAN_RUSTC), "--version")
    found = [int(part) for part in re.findall(r"\d+", version)[:2]]
    needed = [int(part) for part in re.findall(r'rust-version = "(\d+)\.(\d+)', (ROOT / "Cargo.toml").read_text())[0]]
    if found < needed:
        raise SystemExit(f"error: {DEBIAN_RUSTC} is {version}, too old; Rust {needed[0]}.{needed[1]} is needed")
    return Toolchain(
        f"{version}, std compiled with it",
        rustc=str(DEBIAN_RUSTC),
        # build-std is unstable; compiler and sources are of one version here.
        environment={"RUSTC": str(DEBIAN_RUSTC), "RUSTC_BOOTSTRAP": "1"},
        # Without the code that prints backtraces: half of the library, and an importer shows none.
        flags=("-Zbuild-std=std,panic_unwind", "-Zbuild-std-features=panic-unwind"),
    )


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
