"""Compiles the libraries of the FMUs and the wheels of fmu-run for all platforms.

zig links for Linux and Windows, Rust's own linker for macOS. The same sources and tools give the same bytes in any directory.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import macos_linker
from targets import GLIBC, LINUX, MODEL, MODELS, ROOT, TARGETS, WINDOWS, Target

#: Compiles the standard library as well, without the code for backtraces, which would be a third of a library although
#: importers never print a backtrace.
STD = ("-Zbuild-std=std,panic_unwind", "-Zbuild-std-features=panic-unwind")
#: The earliest time in a zip file. A fixed time makes archives reproducible.
EPOCH = "315532800"
#: The Python package fmu-run.
PACKAGE = ROOT / "crates" / "fmu-run"


def log(text: str) -> None:
    """Prints progress, in order with the messages of the started programs."""
    print(text, file=sys.stderr, flush=True)


def run(*command: str, environment: dict[str, str] | None = None, directory: Path = ROOT) -> str:
    """Returns the output of a command. Exits if the command fails."""
    try:
        done = subprocess.run(command, cwd=directory, env=environment, stdout=subprocess.PIPE, text=True)
    except FileNotFoundError:
        raise SystemExit(f"error: {command[0]} is missing; start this with make release") from None
    if done.returncode:
        raise SystemExit(f"error: {' '.join(command)}\nfailed; the messages are above")
    return done.stdout.strip()


@cache
def target_directory() -> Path:
    """Cargo's target directory."""
    return Path(json.loads(run("cargo", "metadata", "--locked", "--no-deps", "--format-version=1"))["target_directory"])


def environment(target: Target | None = None) -> dict[str, str]:
    """The environment of cargo for a target. Messages of the libraries name no directory of this machine."""
    cargo = Path(os.environ.get("CARGO_HOME") or Path.home() / ".cargo")
    (commit,) = re.findall(r"^commit-hash: (\w+)$", run("rustc", "-vV"), re.MULTILINE)
    sysroot = Path(run("rustc", "--print", "sysroot"))
    # rustc uses the last prefix that matches.
    names = {ROOT: MODEL, target_directory(): "target", sysroot / "lib/rustlib/src/rust": f"/rustc/{commit}"}
    names |= dict.fromkeys(sorted((cargo / "registry" / "src").glob("*/")), "crates")
    flags = [f"--remap-path-prefix={path}={name}" for path, name in names.items()]
    path = os.pathsep.join([sysconfig.get_path("scripts"), os.environ["PATH"]])
    found = {**os.environ, "PATH": path}
    if target:
        # With this variable, a stable cargo accepts the unstable options STD.
        found["RUSTC_BOOTSTRAP"] = "1"
    if target is WINDOWS:
        # The linker writes this time, the earliest in a zip file, into the library.
        found["SOURCE_DATE_EPOCH"] = EPOCH
    if target and target.macos:
        flags.insert(0, "-Clinker-flavor=ld64.lld")
        (lld,) = sysroot.glob("lib/rustlib/*/bin/rust-lld")
        found[f"CARGO_TARGET_{target.triple.replace('-', '_').upper()}_LINKER"] = macos_linker.__file__
        found |= {"RUST_LLD": str(lld), "SDKROOT": str(macos_sdk()), "MACOSX_DEPLOYMENT_TARGET": target.macos}
        found["CARGO_PROFILE_RELEASE_STRIP"] = "false"
    # Cargo splits the flags at this character, which paths do not contain.
    return found | {"CARGO_ENCODED_RUSTFLAGS": "\x1f".join(flags)}


def link(target: Target, name: str, exports: Sequence[str]) -> list[str]:
    """Flags of rustc for the library `name` that exports these functions."""
    arguments: Sequence[str] = ()
    if target is WINDOWS:
        # cargo-zigbuild drops the list of exports that rustc writes, and zig would export all functions.
        listed = ROOT / "target" / f"{name}.def"
        listed.parent.mkdir(exist_ok=True)
        listed.write_text("\n".join(["EXPORTS", *exports, ""]), encoding="utf-8")
        # The path is relative, because symbols contain a hash of the flags.
        arguments = (f"target/{listed.name}",)
    elif target.macos:
        # -S -x: strips the library before it is signed.
        arguments = ("-install_name", f"@rpath/{name}", "-dead_strip_dylibs", "-S", "-x")
    return ["--", *(f"-Clink-arg={argument}" for argument in arguments)] if arguments else []


def macos_sdk() -> Path:
    """Makes the part of a macOS SDK that Rust links: zig's list of the functions in libSystem, declared for all Macs. Returns its
    directory."""
    import ziglang

    text = (Path(ziglang.__file__).parent / "lib/libc/darwin/libSystem.tbd").read_text(encoding="utf-8")
    text = re.sub(r"targets:\s*\[[^\]]*\]", "targets: [ x86_64-macos, arm64-macos ]", text)
    directory = target_directory() / "macos-sdk" / "usr" / "lib"
    directory.mkdir(parents=True, exist_ok=True)
    # The other libraries that Rust names are parts of libSystem, or (iconv) are not used.
    for name in ("System", "c", "m", "iconv"):
        (directory / f"lib{name}.tbd").write_text(text, encoding="utf-8")
    return directory.parents[1]


@cache
def library(model: str, target: Target) -> Path:
    """Compiles the library of a model for a target. The exports for Windows are read from the library for Linux."""
    exports: list[str] = []
    if target is WINDOWS:
        listed = run("nm", "-D", "--defined-only", str(library(model, LINUX)))
        exports = [line.split()[-1] for line in listed.splitlines()]
    program, glibc = ("cargo", "") if target.macos else ("cargo-zigbuild", f".{GLIBC}" * ("linux" in target.triple))
    command = [program, "rustc", *STD, "--target", target.triple + glibc, "--package", model, "--no-default-features"]
    command += ["--lib", "--crate-type=cdylib", "--release", "--locked"]
    command += link(target, f"{model}{target.suffix}", exports)
    run(*command, environment=environment(target))
    return target_directory() / target.triple / "release" / target.library(model)


def export_from_object() -> list[str]:
    """Flags of rustc for the library of the wheel for Windows.

    zig reads only the last list of exports, in which maturin 1.16 names PyInit_fmu_run._native, which does not exist.
    Therefore that list is replaced by an empty file, and an object file names the export.
    """
    listed = target_directory() / "maturin" / "fmu_run._native.def"
    listed.parent.mkdir(exist_ok=True)
    listed.unlink(missing_ok=True)
    listed.symlink_to(os.devnull)
    source, compiled = (ROOT / "target" / f"_native.exports.{end}" for end in ("s", "o"))
    source.write_text('.section .drectve,"yni"\n.ascii " -export:PyInit__native"\n', encoding="utf-8")
    zig = (sys.executable, "-m", "ziglang", "cc", "-target", "x86_64-windows-gnu")
    run(*zig, "-c", str(source), "-o", str(compiled))
    return ["--", f"-Clink-arg=target/{compiled.name}"]


def wheel(target: Target, out: Path) -> Path:
    """Builds the wheel of fmu-run for a target and all Python versions from 3.11 on, in `out`, which contains the lists of the
    packages that are compiled into it."""
    command = ["maturin", "build", "--release", *STD, "--target", target.triple, "--out", str(out)]
    command += ["--sbom-include", str(out / "fmu_run.cdx.json")]
    if not target.macos:
        command += ["--zig"]
    if "linux" in target.triple:
        command += ["--compatibility", f"manylinux_{GLIBC.replace('.', '_')}"]
    flags = export_from_object() if target is WINDOWS else link(target, "fmu_run._native.abi3.so", [])
    # pyproject.toml includes all files with such a name.
    licences = PACKAGE / "LICENSE-third-party.txt"
    try:
        shutil.copyfile(out / "fmu_run-third-party.txt", licences)
        run(*command, *flags, environment=environment(target), directory=PACKAGE)
    finally:
        licences.unlink(missing_ok=True)
    (path,) = out.glob(f"fmu_run-*{target.wheel}*.whl")
    return path


def compile_all(out: Path) -> dict[str, dict[Target, Path]]:
    """Compiles the libraries of all models for all targets, and the wheels in `out`."""
    found: dict[str, dict[Target, Path]] = {model: {} for model in MODELS}
    for number, target in enumerate(TARGETS, start=1):
        log(f"[{number}/{len(TARGETS)}] {target.triple}")
        start = time.monotonic()
        paths = [found[model].setdefault(target, library(model, target)) for model in MODELS] + [wheel(target, out)]
        sizes = ", ".join(f"{path.name}: {path.stat().st_size / 1000:.0f} kB" for path in paths)
        log(f"      {sizes}; {time.monotonic() - start:.0f} s")
    return found
