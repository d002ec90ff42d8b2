"""The headers of the libraries in the FMUs and in the wheels, for example exports, imports, and the oldest system that loads them."""

from __future__ import annotations

import hashlib
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path

import fmpy
import lief
import pytest
from conftest import DIST, binaries, wheel
from libraries import EPOCH
from targets import DIRECTORIES, GLIBC, MODELS, TARGETS, WINDOWS, Target

#: Largest size of a library for FMUs, in bytes per target.
LARGEST = 450_000
#: Parts of glibc.
LINUX_LIBRARIES = re.compile(r"lib(c|m|pthread|dl)\.so\.\d|ld-linux-(x86-64|aarch64)\.so\.\d")
#: Parts of Windows from 10 on.
WINDOWS_LIBRARIES = re.compile(r"(kernel32|ntdll|api-ms-win-(core|crt)-\w+-l1-[12]-0)\.dll")


def declared(version: int) -> set[str]:
    """Returns the functions that the header of an FMI version declares."""
    header = Path(fmpy.__file__).parent / "c-code" / f"fmi{version}Functions.h"
    pattern = rf"^ *FMI{version}_Export +fmi{version}\w+TYPE +(fmi{version}\w+);"
    return set(re.findall(pattern, header.read_text(), re.MULTILINE))


FMI2_FUNCTIONS = declared(2)
FMI3_FUNCTIONS = declared(3)
#: The program that packs a library calls two more functions: fmu_export_describe returns the library's description, and
#: fmu_export_report_panics reports the locations of panics.
FUNCTIONS = FMI2_FUNCTIONS | FMI3_FUNCTIONS | {"fmu_export_describe", "fmu_export_report_panics"}
ELF_MACHINE = {"x86_64": lief.ELF.ARCH.X86_64, "aarch64": lief.ELF.ARCH.AARCH64}
MACHO_PROCESSOR = {"x86_64": lief.MachO.Header.CPU_TYPE.X86_64, "aarch64": lief.MachO.Header.CPU_TYPE.ARM64}


def native(target: Target) -> bytes:
    """Returns the library in the wheel for a target."""
    with zipfile.ZipFile(wheel(target)) as archive:
        return archive.read("fmu_run/_native.pyd" if target is WINDOWS else "fmu_run/_native.abi3.so")


def libraries() -> Iterator[object]:
    """Yields all libraries, each with its targets, exports, the name in its header (not compared on Linux), and the names of further
    libraries that it may load."""
    for model in MODELS:
        for directory, content in binaries(DIST / f"{model}.fmu").items():
            name = f"@rpath/{model}.dylib" if "darwin" in directory else f"{model}.dll"
            yield pytest.param(content, DIRECTORIES[directory], FUNCTIONS, name, set(), id=f"{model} {directory}")
    for target in TARGETS:
        name, others = "@rpath/fmu_run._native.abi3.so", set()
        if target is WINDOWS:
            # python3.dll has the functions that all versions of Python 3 share.
            name, others = "_native.dll", {"python3.dll", "bcryptprimitives.dll"}
        yield pytest.param(native(target), (target,), {"PyInit__native"}, name, others, id=target.triple)


def test_the_functions_are_known() -> None:
    assert len(FMI2_FUNCTIONS) == 44 and len(FMI3_FUNCTIONS) == 75


@pytest.mark.parametrize(("content", "targets", "exports", "name", "others"), list(libraries()))
def test_headers(content: bytes, targets: tuple[Target, ...], exports: set[str], name: str, others: set[str]) -> None:
    if exports == FUNCTIONS:
        assert len(content) <= len(targets) * LARGEST
    if "linux" in targets[0].triple:
        linux(lief.ELF.parse(list(content)), targets[0], exports)
    elif targets[0] is WINDOWS:
        windows(lief.PE.parse(list(content)), exports, name, others)
    else:
        macos(content, targets, exports, name)


def linux(elf: lief.ELF.Binary, target: Target, exports: set[str]) -> None:
    """Checks the exports, and that every Linux with the glibc version GLIBC or a newer one can load the library."""
    assert elf.header.machine_type == ELF_MACHINE[target.processor]
    assert {symbol.name for symbol in elf.exported_symbols} == exports
    assert all(LINUX_LIBRARIES.fullmatch(library) for library in elf.libraries), elf.libraries
    versions = {aux.name for needed in elf.symbols_version_requirement for aux in needed.get_auxiliary_symbols()}
    numbers = [[int(number) for number in version.removeprefix("GLIBC_").split(".")] for version in versions]
    assert numbers and max(numbers) <= [int(number) for number in GLIBC.split(".")], versions
    tag = lief.ELF.DynamicEntry.TAG
    assert not {entry.tag for entry in elf.dynamic_entries} & {tag.RPATH, tag.RUNPATH, tag.TEXTREL}
    # Without this segment, the loader makes the stack of the importer executable or rejects the library.
    (stack,) = [segment for segment in elf.segments if segment.type == lief.ELF.Segment.TYPE.GNU_STACK]
    assert not stack.has(lief.ELF.Segment.FLAGS.X)
    # Older loaders need .hash, newer tools .gnu.hash.
    assert {section.name for section in elf.sections} >= {".hash", ".gnu.hash"}
    assert not list(elf.symtab_symbols), "not stripped"


def windows(pe: lief.PE.Binary, exports: set[str], name: str, others: set[str]) -> None:
    """Checks the exports, and that every Windows from 10 on can load the library."""
    assert pe.header.machine == lief.PE.Header.MACHINE_TYPES.AMD64
    assert {entry.name for entry in pe.get_export().entries} == exports
    assert pe.get_export().name == name
    imports = {entry.name.lower() for entry in pe.imports} - others
    assert all(WINDOWS_LIBRARIES.fullmatch(library) for library in imports), imports
    flags = lief.PE.OptionalHeader.DLL_CHARACTERISTICS
    assert pe.optional_header.has(flags.NX_COMPAT) and pe.optional_header.has(flags.DYNAMIC_BASE)
    assert (pe.header.time_date_stamps, pe.get_export().timestamp) == (int(EPOCH), 0)
    assert pe.header.pointerto_symbol_table == 0, "not stripped"


def macos(content: bytes, targets: tuple[Target, ...], exports: set[str], name: str) -> None:
    """Checks the exports, and that every macOS from the oldest version of the targets on can load the library."""
    fat = lief.MachO.parse(list(content))
    parts = [fat.at(index) for index in range(fat.size)]
    wanted = {MACHO_PROCESSOR[target.processor]: target for target in targets}
    assert {part.header.cpu_type for part in parts} == set(wanted)
    for part in parts:
        assert part.header.file_type == lief.MachO.Header.FILE_TYPE.DYLIB
        commands = list(part.commands)
        (own,) = [command for command in commands if command.command == lief.MachO.LoadCommand.TYPE.ID_DYLIB]
        assert own.name == name
        assert {command.name for command in part.libraries} == {own.name, "/usr/lib/libSystem.B.dylib"}
        assert not [command for command in commands if command.command == lief.MachO.LoadCommand.TYPE.RPATH]
        assert {symbol.name for symbol in part.exported_symbols} == {f"_{function}" for function in exports}
        oldest = part.build_version.minos if part.has_build_version else part.version_min.version
        assert oldest[:2] == [int(number) for number in wanted[part.header.cpu_type].macos.split(".")]
        if part.header.cpu_type == MACHO_PROCESSOR["aarch64"]:
            is_signed(content[part.fat_offset :], part)
        if exports != FUNCTIONS:
            python = [s.binding_info.library_ordinal for s in part.imported_symbols if s.name.startswith("_Py")]
            # BIND_SPECIAL_DYLIB_FLAT_LOOKUP: dyld searches the process that loads the library, which is Python.
            assert python and set(python) == {-2}


def is_signed(content: bytes, part: lief.MachO.Binary) -> None:
    """Checks the signature, because ARM Macs end a process that loads a library whose pages differ from the hashes in the signature."""
    signature = content[part.code_signature.data_offset :][: part.code_signature.data_size]

    def field(at: int, offset: int = 0) -> int:
        return int.from_bytes(signature[offset + at : offset + at + 4], "big")

    assert field(0) == 0xFADE0CC0  # CSMAGIC_EMBEDDED_SIGNATURE
    # The signature lists blobs, each by type and offset; type 0 is the code directory (xnu, osfmk/kern/cs_blobs.h).
    offsets = {field(12 + 8 * index): field(16 + 8 * index) for index in range(field(8))}
    directory = offsets[0]
    assert field(0, directory) == 0xFADE0C02
    hashes, pages, end = field(16, directory), field(28, directory), field(32, directory)
    size, kind = signature[directory + 36], signature[directory + 37]
    page = 1 << signature[directory + 39]
    assert (size, kind) == (32, 2) and end == part.code_signature.data_offset and pages == -(-end // page)
    for index in range(pages):
        expected = signature[directory + hashes + size * index :][:size]
        assert hashlib.sha256(content[index * page : min((index + 1) * page, end)]).digest() == expected, index
