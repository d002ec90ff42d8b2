"""What the libraries export, import and promise, read from their headers."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import fmpy
import lief
import pytest
from conftest import INCLUDED, ROOT, library
from targets import FOLDERS, GLIBC, MODEL, TARGETS

#: kB
LARGEST = 600

FMI2_FUNCTIONS = {f"fmi2{name}" for name in re.findall(r"F\((\w+)\)", (INCLUDED[0] / "fmu.h").read_text())}
#: Those of the header of the standard, which FMPy brings.
FMI3_HEADER = Path(fmpy.__file__).parent / "c-code" / "fmi3Functions.h"
FMI3_FUNCTIONS = set(re.findall(r"^FMI3_Export +fmi3\w+TYPE +(fmi3\w+);", FMI3_HEADER.read_text(), re.MULTILINE))
FUNCTIONS = FMI2_FUNCTIONS | FMI3_FUNCTIONS

#: glibc and nothing else; part of every Linux that is not musl's.
LINUX_LIBRARIES = {"libc.so.6", "libm.so.6", "libpthread.so.0", "libdl.so.2", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}

#: Part of every Windows from 10 on.
WINDOWS_LIBRARIES = {"kernel32.dll", "ntdll.dll", "msvcrt.dll", "api-ms-win-core-synch-l1-2-0.dll"}

ELF_MACHINE = {"linux64": lief.ELF.ARCH.X86_64, "aarch64-linux": lief.ELF.ARCH.AARCH64}
PROCESSORS = {"x86_64": lief.MachO.Header.CPU_TYPE.X86_64, "aarch64": lief.MachO.Header.CPU_TYPE.ARM64}


def slices(path: Path) -> list[lief.MachO.Binary]:
    """The libraries in a macOS library."""
    fat = lief.MachO.parse(str(path))
    return [fat.at(index) for index in range(fat.size)]


def test_the_functions_are_known():
    assert len(FMI2_FUNCTIONS) == 44 and len(FMI3_FUNCTIONS) == 75


def test_small(unpacked, folder):
    path = library(unpacked, folder)
    parts = len(FOLDERS[folder])
    assert path.stat().st_size <= parts * LARGEST * 1000, f"{folder}: {path.stat().st_size}"


def test_no_names_of_folders(unpacked, folder):
    content = library(unpacked, folder).read_bytes()
    for name in (str(ROOT), str(Path.home()), "/.cargo/", "rustlib", "/usr/src"):
        assert name.encode() not in content, f"{folder} contains {name}"


@pytest.mark.parametrize("folder", ["linux64", "aarch64-linux"], indirect=True)
def test_linux(unpacked, folder):
    elf = lief.ELF.parse(str(library(unpacked, folder)))
    assert elf.header.machine_type == ELF_MACHINE[folder]
    assert {symbol.name for symbol in elf.exported_symbols} == FUNCTIONS
    assert set(elf.libraries) <= LINUX_LIBRARIES
    versions = {aux.name for needed in elf.symbols_version_requirement for aux in needed.get_auxiliary_symbols()}
    assert versions and all(re.fullmatch(r"GLIBC_[\d.]+", version) for version in versions)
    number = lambda version: [int(part) for part in version.split("_")[-1].split(".")]  # noqa: E731
    assert max(map(number, versions)) <= number(GLIBC), versions
    tags = {entry.tag for entry in elf.dynamic_entries}
    assert not tags & {lief.ELF.DynamicEntry.TAG.RPATH, lief.ELF.DynamicEntry.TAG.RUNPATH, lief.ELF.DynamicEntry.TAG.TEXTREL}
    # Without this the loader makes the importer's stack executable, or refuses.
    (stack,) = [segment for segment in elf.segments if segment.type == lief.ELF.Segment.TYPE.GNU_STACK]
    assert not stack.has(lief.ELF.Segment.FLAGS.X)
    # Older loaders know only the one, newer tools only the other.
    assert {section.name for section in elf.sections} >= {".hash", ".gnu.hash"}
    assert not list(elf.symtab_symbols), "not stripped"


@pytest.mark.parametrize("folder", ["win64"], indirect=True)
def test_windows(unpacked, folder):
    path = library(unpacked, folder)
    pe = lief.PE.parse(str(path))
    assert pe.header.machine == lief.PE.Header.MACHINE_TYPES.AMD64
    assert {entry.name for entry in pe.get_export().entries} == FUNCTIONS
    assert pe.get_export().name == path.name
    assert {entry.name.lower() for entry in pe.imports} <= WINDOWS_LIBRARIES
    assert not any(entry.forward_information for entry in pe.get_export().entries if entry.is_forwarded)
    promises = lief.PE.OptionalHeader.DLL_CHARACTERISTICS
    assert pe.optional_header.has(promises.NX_COMPAT) and pe.optional_header.has(promises.DYNAMIC_BASE)
    assert pe.header.time_date_stamps == 0 and pe.get_export().timestamp == 0
    assert pe.header.pointerto_symbol_table == 0, "not stripped"


@pytest.mark.parametrize("folder", ["darwin64", "aarch64-darwin"], indirect=True)
def test_macos(unpacked, folder):
    path = library(unpacked, folder)
    parts = slices(path)
    wanted = {target.triple.split("-")[0]: target for target in FOLDERS[folder]}
    assert {part.header.cpu_type for part in parts} == {PROCESSORS[name] for name in wanted}
    for part, target in ((part, wanted[name]) for part in parts for name in wanted if part.header.cpu_type == PROCESSORS[name]):
        assert part.header.file_type == lief.MachO.Header.FILE_TYPE.DYLIB
        commands = [command for command in part.commands]
        (own,) = [command for command in commands if command.command == lief.MachO.LoadCommand.TYPE.ID_DYLIB]
        assert own.name == f"@rpath/{MODEL}.dylib"
        assert {command.name for command in part.libraries} == {own.name, "/usr/lib/libSystem.B.dylib"}
        assert not [command for command in commands if command.command == lief.MachO.LoadCommand.TYPE.RPATH]
        assert {symbol.name for symbol in part.exported_symbols} == {f"_{name}" for name in FUNCTIONS}
        oldest = part.build_version.minos if part.has_build_version else part.version_min.version
        assert oldest[:2] == [int(number) for number in target.macos.split(".")]


@pytest.mark.parametrize("folder", ["darwin64", "aarch64-darwin"], indirect=True)
def test_macos_runs_only_what_is_signed(unpacked, folder):
    """ARM Macs end a process that loads a library whose pages differ from the hashes in its signature."""
    content = library(unpacked, folder).read_bytes()
    (part,) = [part for part in slices(library(unpacked, folder)) if part.header.cpu_type == PROCESSORS["aarch64"]]
    content = content[part.fat_offset :]
    signature = content[part.code_signature.data_offset :][: part.code_signature.data_size]
    field = lambda at, offset=0: int.from_bytes(signature[offset + at : offset + at + 4], "big")  # noqa: E731
    assert field(0) == 0xFADE0CC0  # CSMAGIC_EMBEDDED_SIGNATURE
    # A super blob of blobs: type and offset each; type 0 is the code directory (xnu, osfmk/kern/cs_blobs.h).
    offsets = {field(12 + 8 * index): field(16 + 8 * index) for index in range(field(8))}
    directory = offsets[0]
    assert field(0, directory) == 0xFADE0C02
    hashes, pages, end = field(16, directory), field(28, directory), field(32, directory)
    size, kind = signature[directory + 36], signature[directory + 37]
    page = 1 << signature[directory + 39]
    assert (size, kind) == (32, 2) and end == part.code_signature.data_offset and pages == -(-end // page)
    for index in range(pages):
        expected = signature[directory + hashes + size * index :][:size]
        assert hashlib.sha256(content[index * page : min((index + 1) * page, end)]).digest() == expected, f"page {index}"


def test_every_target_is_in_the_fmu():
    assert {target for targets in FOLDERS.values() for target in targets} == set(TARGETS)
