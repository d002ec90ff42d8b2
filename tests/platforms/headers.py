"""What a library exports, imports and promises, read from its headers: one check for each kind of library."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

import lief
from targets import GLIBC, Target

#: glibc and nothing else; part of every Linux that is not musl's.
LINUX_LIBRARIES = {
    "libc.so.6",
    "libm.so.6",
    "libpthread.so.0",
    "libdl.so.2",
    "ld-linux-x86-64.so.2",
    "ld-linux-aarch64.so.1",
}

#: Part of every Windows from 10 on.
WINDOWS_LIBRARIES = {"kernel32.dll", "ntdll.dll", "msvcrt.dll", "api-ms-win-core-synch-l1-2-0.dll"}

ELF_MACHINE = {"x86_64": lief.ELF.ARCH.X86_64, "aarch64": lief.ELF.ARCH.AARCH64}
PROCESSORS = {"x86_64": lief.MachO.Header.CPU_TYPE.X86_64, "aarch64": lief.MachO.Header.CPU_TYPE.ARM64}


def processor(target: Target) -> str:
    """The processor of a target."""
    return target.triple.split("-")[0]


def slices(path: Path) -> list[lief.MachO.Binary]:
    """The libraries in a macOS library."""
    fat = lief.MachO.parse(str(path))
    return [fat.at(index) for index in range(fat.size)]


def linux(path: Path, target: Target, exported: set[str]) -> None:
    """A library that every Linux from GLIBC on loads."""
    elf = lief.ELF.parse(str(path))
    assert elf.header.machine_type == ELF_MACHINE[processor(target)]
    assert {symbol.name for symbol in elf.exported_symbols} == exported
    assert set(elf.libraries) <= LINUX_LIBRARIES
    versions = {aux.name for needed in elf.symbols_version_requirement for aux in needed.get_auxiliary_symbols()}
    assert versions and all(re.fullmatch(r"GLIBC_[\d.]+", version) for version in versions)
    number = lambda version: [int(part) for part in version.split("_")[-1].split(".")]  # noqa: E731
    assert max(map(number, versions)) <= number(GLIBC), versions
    tags = {entry.tag for entry in elf.dynamic_entries}
    assert not tags & {
        lief.ELF.DynamicEntry.TAG.RPATH,
        lief.ELF.DynamicEntry.TAG.RUNPATH,
        lief.ELF.DynamicEntry.TAG.TEXTREL,
    }
    # Without this the loader makes the importer's stack executable, or refuses.
    (stack,) = [segment for segment in elf.segments if segment.type == lief.ELF.Segment.TYPE.GNU_STACK]
    assert not stack.has(lief.ELF.Segment.FLAGS.X)
    # Older loaders know only the one, newer tools only the other.
    assert {section.name for section in elf.sections} >= {".hash", ".gnu.hash"}
    assert not list(elf.symtab_symbols), "not stripped"


def windows(path: Path, exported: set[str], name: str, others: set[str] = frozenset()) -> None:
    """A library called `name` that every Windows from 10 on loads; it may take from these, too."""
    pe = lief.PE.parse(str(path))
    assert pe.header.machine == lief.PE.Header.MACHINE_TYPES.AMD64
    assert {entry.name for entry in pe.get_export().entries} == exported
    assert pe.get_export().name == name
    assert {entry.name.lower() for entry in pe.imports} <= WINDOWS_LIBRARIES | others
    assert not any(entry.forward_information for entry in pe.get_export().entries if entry.is_forwarded)
    promises = lief.PE.OptionalHeader.DLL_CHARACTERISTICS
    assert pe.optional_header.has(promises.NX_COMPAT) and pe.optional_header.has(promises.DYNAMIC_BASE)
    assert pe.header.time_date_stamps == 0 and pe.get_export().timestamp == 0
    assert pe.header.pointerto_symbol_table == 0, "not stripped"


def macos(path: Path, targets: tuple[Target, ...], exported: set[str], name: str) -> None:
    """A library called `name` for the processors of the targets, and for macOS from theirs on."""
    parts = slices(path)
    wanted = {PROCESSORS[processor(target)]: target for target in targets}
    assert {part.header.cpu_type for part in parts} == set(wanted)
    for part in parts:
        assert part.header.file_type == lief.MachO.Header.FILE_TYPE.DYLIB
        commands = list(part.commands)
        (own,) = [command for command in commands if command.command == lief.MachO.LoadCommand.TYPE.ID_DYLIB]
        assert own.name == name
        assert {command.name for command in part.libraries} == {own.name, "/usr/lib/libSystem.B.dylib"}
        assert not [command for command in commands if command.command == lief.MachO.LoadCommand.TYPE.RPATH]
        assert {symbol.name for symbol in part.exported_symbols} == {f"_{function}" for function in exported}
        oldest = part.build_version.minos if part.has_build_version else part.version_min.version
        assert oldest[:2] == [int(number) for number in wanted[part.header.cpu_type].macos.split(".")]


def macos_signature(path: Path) -> None:
    """ARM Macs end a process that loads a library whose pages differ from the hashes in its signature."""
    content = path.read_bytes()
    (part,) = [part for part in slices(path) if part.header.cpu_type == PROCESSORS["aarch64"]]
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
        assert hashlib.sha256(content[index * page : min((index + 1) * page, end)]).digest() == expected, (
            f"page {index}"
        )
