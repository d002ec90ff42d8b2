"""Compiles the library of the FMU for other platforms.

    python platforms/libraries.py FOLDER TRIPLE...

puts FOLDER/TRIPLE/LIBRARY there. The same sources and tools give the same bytes, wherever they are.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import macos_linker
import mingw_linker
import toolchain as tools
from targets import GLIBC, MODEL, ROOT, Target, target


def compile_library(target: Target) -> tuple[Path, str]:
    """The library and a line that says what compiled it."""
    toolchain, environment, glibc = prepare(target, f"@rpath/{MODEL}{target.suffix}")
    command = [tools.zigbuild() if glibc else "cargo", "rustc", *toolchain.flags]
    command += ["--lib", "--crate-type", "cdylib", "--profile", "library", "--locked"]
    command += ["--no-default-features", "--package", MODEL, "--target", target.triple + (f".{GLIBC}" if glibc else "")]
    if subprocess.run(command, cwd=ROOT, env=environment).returncode:
        raise SystemExit(f"error: the library for {target.triple} could not be compiled; the messages are above")
    return target_folder() / target.triple / "library" / target.library, toolchain.description


def prepare(target: Target, name: str = "") -> tuple[tools.Toolchain, dict[str, str], bool]:
    """What compiles for a target from here: toolchain, environment, and whether zig links.

    name: what a macOS library is to be called by those who link to it.
    """
    toolchain = tools.toolchain(target)
    environment, flags, glibc = link(target, name)
    flags += [f"--remap-path-prefix={path}={shown}" for path, shown in remap(toolchain)]
    environment = {**os.environ, **toolchain.environment, **environment}
    # Separated by what no path contains.
    environment["CARGO_ENCODED_RUSTFLAGS"] = "\x1f".join(flags)
    return toolchain, environment, glibc


def link(target: Target, name: str) -> tuple[dict[str, str], list[str], bool]:
    """How to link for a target from here: environment, rustc's flags, and whether zig does it."""
    if "linux" in target.triple:
        # cargo-zigbuild looks for zig and, when it is called as the linker, for itself.
        return {"PATH": os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])}, [], True
    if target.triple.endswith("-windows-gnu"):
        tools.need(mingw_linker.LINKER)
        environment = {f"{target.environment}LINKER": mingw_linker.__file__, "PRW_TARGET_FOLDER": str(target_folder())}
        return environment, ["-Clink-arg=-Wl,--no-insert-timestamp"], False
    if target.triple.endswith("-windows-msvc"):
        return {}, ["-Ctarget-feature=+crt-static", "-Clink-arg=/Brepro"], False

    # -S -x: what `strip` would do, but before the library is signed.
    arguments = [*(["-install_name", name] if name else []), "-dead_strip_dylibs", "-S", "-x"]
    environment = {"CARGO_PROFILE_LIBRARY_STRIP": "false", "MACOSX_DEPLOYMENT_TARGET": target.macos}
    if sys.platform == "darwin":
        return environment, [f"-Clink-arg=-Wl,{','.join(arguments)}"], False
    environment[f"{target.environment}LINKER"] = macos_linker.__file__
    environment["PRW_RUST_LLD"] = tools.rust_lld()
    environment["SDKROOT"] = str(tools.macos_sdk())
    return environment, ["-Clinker-flavor=ld64.lld", *(f"-Clink-arg={a}" for a in arguments)], False


def remap(toolchain: tools.Toolchain) -> list[tuple[Path, str]]:
    """Folders whose names would get into the library through messages of a panic."""
    cargo = Path(os.environ.get("CARGO_HOME") or Path.home() / ".cargo")
    crates = sorted((cargo / "registry" / "src").glob("*/"))
    std = toolchain.sysroot / "lib/rustlib/src/rust"
    # The last that fits counts.
    return [(ROOT, MODEL), (target_folder(), "target"), (std, "rust"), *((path, "crates") for path in crates)]


def target_folder() -> Path:
    """Cargo's target folder."""
    command = ["cargo", "metadata", "--locked", "--no-deps", "--format-version", "1"]
    metadata = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return Path(json.loads(metadata)["target_directory"])


def universal(destination: Path, libraries: list[Path]) -> Path:
    """Joins macOS libraries for several processors."""
    from fat_macho import FatWriter

    writer = FatWriter()
    for library in libraries:
        writer.add(library.read_bytes())
    destination.parent.mkdir(parents=True, exist_ok=True)
    writer.write_to(str(destination))
    return destination


def main(folder: str, *triples: str) -> None:
    for triple in triples:
        library, compiled_by = compile_library(target(triple))
        destination = Path(folder) / triple / library.name
        destination.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(library, destination)
        print(f"{destination}: {destination.stat().st_size / 1000:.0f} kB, {compiled_by}")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    main(*sys.argv[1:])
