"""Compiles the libraries of the FMUs for other platforms.

    python platforms/libraries.py FOLDER TRIPLE...

puts them in FOLDER/TRIPLE/, and beside them compiler.txt. The same sources and tools give the same bytes, wherever they
are.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import macos_linker
import mingw_linker
import toolchain as tools
from targets import GLIBC, MODEL, MODELS, PACKERS, ROOT, WEBASSEMBLY, Target, target

#: Beside the libraries: what compiled them.
COMPILER = "compiler.txt"


def compile_library(model: str, target: Target) -> tuple[Path, str]:
    """The library of a model and what compiled it."""
    toolchain, environment, glibc = prepare(target, f"@rpath/{model}{target.suffix}")
    environment["FMU_GUID"] = guid(model)
    command = [tools.zigbuild() if glibc else "cargo", "rustc", *toolchain.flags]
    command += ["--lib", "--crate-type", "cdylib", "--profile", "library", "--locked"]
    command += ["--no-default-features", "--package", model, "--target", target.triple + (f".{GLIBC}" if glibc else "")]
    if subprocess.run(command, cwd=ROOT, env=environment).returncode:
        raise SystemExit(f"error: {model} could not be compiled for {target.triple}; the messages are above")
    return target_folder() / target.triple / "library" / target.library(model), toolchain.description


@cache
def guid(model: str) -> str:
    """The guid of a model's FMU, which is compiled into its libraries."""
    program, package = PACKERS[model]
    command = ["cargo", "run", "--quiet", "--locked", "--release", "--package", package, "--bin", program]
    done = subprocess.run([*command, "--", "--guid"], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"error: the program that packs {model} could not be made; the messages are above")
    return done.stdout.strip()


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
    if target is WEBASSEMBLY:
        return {}, [], False
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
    std = (toolchain.sysroot / "lib/rustlib/src/rust", f"/rustc/{toolchain.commit}")
    # The last that fits counts.
    return [(ROOT, MODEL), (target_folder(), "target"), std, *((path, "crates") for path in crates)]


def target_folder() -> Path:
    """Cargo's target folder."""
    command = ["cargo", "metadata", "--locked", "--no-deps", "--format-version", "1"]
    metadata = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    return Path(json.loads(metadata)["target_directory"])


def compile_all(folder: Path, targets: Sequence[Target]) -> None:
    """Puts the libraries of all models for these targets in FOLDER/TRIPLE."""
    for number, each in enumerate(targets, start=1):
        tools.say(f"[{number}/{len(targets)}] libraries for {each.triple}")
        start = time.monotonic()
        destination = folder / each.triple
        destination.mkdir(parents=True, exist_ok=True)
        for model in MODELS:
            library, compiler = compile_library(model, each)
            shutil.copyfile(library, destination / library.name)
            tools.say(f"      {library.name}: {library.stat().st_size / 1000:.0f} kB")
        (destination / COMPILER).write_text(f"{compiler}\n", encoding="utf-8")
        tools.say(f"      {compiler}, {time.monotonic() - start:.0f} s")


if __name__ == "__main__":
    if len(sys.argv) < 3:
        raise SystemExit(__doc__)
    compile_all(Path(sys.argv[1]), [target(triple) for triple in sys.argv[2:]])
