//! The libraries of an FMU: the file for this platform, and what the headers of a file state (ELF, PE, Mach-O).

use crate::{Standard, shown};
use object::macho::FatArch32;
use object::read::elf::ElfFile;
use object::read::elf::{FileHeader, Sym};
use object::read::macho::{FatArch, MachOFatFile32};
use object::{Architecture, File, FileKind, Object, ObjectKind};
use std::env::consts::{ARCH, DLL_SUFFIX, OS};
use std::path::{Path, PathBuf};

/// A library for one processor: a file, or a part of a universal file for macOS.
#[derive(Clone, Copy, Debug)]
pub struct Binary<'a> {
    /// The operating system, with the name of `std::env::consts::OS`.
    pub system: &'static str,
    /// The processor, with the name of `std::env::consts::ARCH`; `None` for processors that have no name in this project.
    pub processor: Option<&'static str>,
    bytes: &'a [u8],
}

impl<'a> Binary<'a> {
    /// Reads the headers of a library, or of each part of a universal library for macOS.
    ///
    /// # Errors
    /// Fails if the file is in another format, or its headers are truncated or damaged.
    pub fn all(bytes: &'a [u8]) -> Result<Vec<Self>, String> {
        let error = |error: object::Error| error.to_string();
        let part = |system, architecture, bytes| Self { system, processor: processor(architecture), bytes };
        let system = match FileKind::parse(bytes).map_err(error)? {
            FileKind::Elf32 | FileKind::Elf64 => "linux",
            FileKind::Pe32 | FileKind::Pe64 => "windows",
            FileKind::MachO32 | FileKind::MachO64 => "macos",
            FileKind::MachOFat32 => {
                let parts = MachOFatFile32::parse(bytes).map_err(error)?.arches();
                if parts.is_empty() {
                    return Err("it has no parts".to_owned());
                }
                let part =
                    |it: &FatArch32| Ok(part("macos", it.architecture(), it.data(bytes).map_err(error)?));
                return parts.iter().map(part).collect();
            }
            other => return Err(format!("the format {other:?} is not a format of libraries")),
        };
        Ok(vec![part(system, File::parse(bytes).map_err(error)?.architecture(), bytes)])
    }

    /// Returns the processor as directories of FMI 3.0 name it (section 2.5.1.4.1 of FMI 3.0).
    pub fn processor_in_fmi3(&self) -> Option<&'static str> {
        self.processor.map(name_in_fmi3)
    }

    fn file(&self) -> Option<File<'a>> {
        File::parse(self.bytes).ok()
    }

    /// Whether a loader can add it to a program. Also true for programs that can be loaded at any address.
    pub fn is_shared(&self) -> bool {
        self.file().is_some_and(|file| file.kind() == ObjectKind::Dynamic)
    }

    /// Returns the names that it exports, as C programs write them; `None` if they cannot be read.
    pub fn exports(&self) -> Option<Vec<String>> {
        let file = self.file()?;
        let exports = file.exports().ok()?;
        let name = |name: &[u8]| {
            // C compilers for macOS prefix an underscore.
            let name = if self.system == "macos" { name.strip_prefix(b"_").unwrap_or(name) } else { name };
            String::from_utf8_lossy(name).into_owned()
        };
        Some(exports.flatten().filter_map(|export| export.name().name().map(name)).collect())
    }

    /// Returns the names of the libraries that the loader loads with it, sorted.
    pub fn needed_libraries(&self) -> Vec<String> {
        let file = self.file();
        let libraries = file.as_ref().and_then(|file| file.import_libraries().ok());
        let name = |library: &[u8]| String::from_utf8_lossy(library).into_owned();
        let mut names: Vec<_> =
            libraries.into_iter().flatten().flatten().map(|library| name(library.name())).collect();
        names.sort();
        names.dedup();
        names
    }

    /// Returns the oldest version of glibc with which it loads, from the versions that it requires (section `.gnu.version_r`). `None`
    /// if it is not for Linux or does not use glibc.
    pub fn needed_glibc(&self) -> Option<(u32, u32)> {
        match self.file()? {
            File::Elf32(file) => needed_glibc(&file),
            File::Elf64(file) => needed_glibc(&file),
            _ => None,
        }
    }

    /// Returns the undefined global symbols without a version in a library for Linux, if other undefined symbols have a version. If the
    /// library links only to system libraries, whose symbols have versions, the linker has found these symbols in none of them. Then
    /// only the program that loads the library can provide them.
    pub fn unversioned_symbols(&self) -> Vec<String> {
        match self.file() {
            Some(File::Elf32(file)) => unversioned_symbols(&file),
            Some(File::Elf64(file)) => unversioned_symbols(&file),
            _ => Ok(Vec::new()),
        }
        .unwrap_or_default()
    }
}

/// Returns the name of a processor in `std::env::consts::ARCH`.
fn processor(architecture: Architecture) -> Option<&'static str> {
    Some(match architecture {
        Architecture::X86_64 => "x86_64",
        Architecture::I386 => "x86",
        Architecture::Aarch64 => "aarch64",
        Architecture::Arm => "arm",
        Architecture::Riscv64 => "riscv64",
        Architecture::Riscv32 => "riscv32",
        Architecture::PowerPc64 => "powerpc64",
        Architecture::S390x => "s390x",
        Architecture::LoongArch64 => "loongarch64",
        _ => return None,
    })
}

/// Returns the name in FMI 3.0 of a processor, which has the name of `std::env::consts::ARCH`.
fn name_in_fmi3(processor: &'static str) -> &'static str {
    match processor {
        "arm" => "aarch32",
        "powerpc64" => "ppc64",
        other => other,
    }
}

fn needed_glibc<Header: FileHeader<Endian = object::Endianness>>(
    file: &ElfFile<Header>,
) -> Option<(u32, u32)> {
    let (sections, endian, bytes) = (file.elf_section_table(), file.endian(), file.data());
    let (needs, strings) = sections.gnu_verneed(endian, bytes).ok()??;
    let strings = sections.strings(endian, bytes, strings).ok()?;
    let version = |name: &[u8]| {
        let mut numbers = std::str::from_utf8(name).ok()?.strip_prefix("GLIBC_")?.split('.');
        Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
    };
    let versions = needs.flatten().flat_map(|(_, versions)| versions.flatten());
    versions.filter_map(|needed| version(needed.name(endian, strings).ok()?)).max()
}

fn unversioned_symbols<Header: FileHeader<Endian = object::Endianness>>(
    file: &ElfFile<Header>,
) -> object::Result<Vec<String>> {
    let (sections, endian, bytes) = (file.elf_section_table(), file.endian(), file.data());
    let symbols = sections.symbols(endian, bytes, object::elf::SHT_DYNSYM)?;
    let Some(versions) = sections.versions(endian, bytes)? else { return Ok(Vec::new()) };
    let (mut found, mut versioned) = (Vec::new(), false);
    for (index, symbol) in symbols.enumerate() {
        if !symbol.is_undefined(endian) || symbol.st_bind() != object::elf::STB_GLOBAL {
            continue;
        }
        // 0 and 1 mean that the symbol has no version.
        if versions.version_index(endian, index).index() > object::elf::VER_NDX_GLOBAL {
            versioned = true;
        } else {
            found.push(String::from_utf8_lossy(symbol.name(endian, symbols.strings())?).into_owned());
        }
    }
    found.retain(|name| versioned && !name.is_empty());
    Ok(found)
}

/// Returns the names of the directories in `binaries/` that may contain a library for this platform. FMI 2.0 has no names for ARM.
/// Some FMUs for ARM use the names of FMI 3.0, others the names of FMI 2.0, such as `linux64`, so both are tried.
fn directories(standard: Standard) -> Vec<String> {
    let system = if OS == "macos" { "darwin" } else { OS };
    let tuple = format!("{}-{system}", name_in_fmi3(ARCH));
    let short = match (system, usize::BITS) {
        ("windows", bits) => format!("win{bits}"),
        (system, bits) => format!("{system}{bits}"),
    };
    match (standard, ARCH) {
        (Standard::Fmi3, _) => vec![tuple],
        (Standard::Fmi2, "x86_64" | "x86") => vec![short, tuple],
        (Standard::Fmi2, _) => vec![tuple, short],
    }
}

/// Returns the path of the library with this `modelIdentifier` for this platform. `directory` has the unpacked FMU.
///
/// # Errors
/// Fails if the FMU has no library for this platform. The message continues a sentence about the FMU, and lists its libraries.
pub fn find_library(directory: &Path, standard: Standard, identifier: &str) -> Result<PathBuf, String> {
    let name = format!("{identifier}{DLL_SUFFIX}");
    let directories = directories(standard);
    let binaries = directory.join("binaries");
    let mut others: Vec<_> = std::fs::read_dir(&binaries)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    others.sort();
    // The name of a directory may also contain the ABI, such as x86_64-linux-gnu (section 2.5.1.4.1 of FMI 3.0).
    let with_abi = format!("{}-", directories[0]);
    let has_abi = |other: &&String| standard == Standard::Fmi3 && other.starts_with(&with_abi);
    let candidates = directories.iter().chain(others.iter().filter(has_abi));
    if let Some(found) = candidates.map(|other| binaries.join(other).join(&name)).find(|path| path.is_file())
    {
        return Ok(found);
    }
    if others.is_empty() && directory.join("sources").is_dir() {
        return Err(
            "has only C sources, which must be compiled first; `fmpy compile FMU` of FMPy does it".to_owned()
        );
    }
    // Names the files in the directories, because a directory for this platform may contain a library with another name.
    let files = |other: &String| {
        let entries = std::fs::read_dir(binaries.join(other)).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let mut names: Vec<_> = names.map(|name| format!("{}/{}", shown(other), shown(&name))).collect();
        names.sort();
        names
    };
    let others: Vec<_> = others.iter().flat_map(files).collect();
    let others = if others.is_empty() { "none".to_owned() } else { others.join(", ") };
    Err(format!("has no library for this platform (binaries/{}/{name}); it has: {others}", directories[0]))
}

#[cfg(test)]
mod tests {
    use super::Binary;

    fn platforms(bytes: &[u8]) -> Option<Vec<(&'static str, Option<&'static str>)>> {
        let binaries = Binary::all(bytes).ok()?;
        Some(binaries.iter().map(|binary| (binary.system, binary.processor)).collect())
    }

    /// Headers that this test creates as the specifications describe them. Other tests read files that linkers wrote.
    #[test]
    fn headers() {
        let elf = |class: u8, order: u8, machine: [u8; 2]| {
            let version = if order == 2 { [0, 0, 0, 1] } else { [1, 0, 0, 0] };
            let head = [b"\x7fELF".as_slice(), &[class, order, 1], &[0; 9], &[0; 2], &machine, &version];
            let mut bytes = head.concat();
            bytes.resize(64, 0);
            bytes
        };
        let of_elf = |bytes: &[u8]| platforms(bytes).expect("ELF")[0];
        assert_eq!(of_elf(&elf(2, 1, [62, 0])), ("linux", Some("x86_64")));
        assert_eq!(of_elf(&elf(1, 1, [243, 0])), ("linux", Some("riscv32")));
        assert_eq!(of_elf(&elf(2, 2, [0, 22])), ("linux", Some("s390x")));
        assert_eq!(of_elf(&elf(2, 1, [2, 1])), ("linux", Some("loongarch64")));
        assert_eq!(of_elf(&elf(2, 1, [0xff, 0xff])), ("linux", None));
        let mach = [&[0xcf, 0xfa, 0xed, 0xfe, 0x0c, 0, 0, 1][..], &[0; 24]].concat();
        assert_eq!(platforms(&mach), Some(vec![("macos", Some("aarch64"))]));
        let mut universal: Vec<u8> = [0xcafe_babe, 2, 0x0100_0007, 0, 48, 0, 0, 0x0100_000c, 0, 48, 32, 0]
            .map(u32::to_be_bytes)
            .concat();
        universal.extend(&mach);
        assert_eq!(platforms(&universal), Some(vec![("macos", Some("x86_64")), ("macos", Some("aarch64"))]));
        // The offset of the PE header is at 0x3c. It has 20 bytes, and 112 more that are optional in other files.
        let mut pe = vec![0; 0x40 + 4 + 20 + 112];
        pe[..2].copy_from_slice(b"MZ");
        pe[0x3c] = 0x40;
        pe[0x40..0x46].copy_from_slice(b"PE\0\0\x64\xaa");
        pe[0x54] = 112;
        pe[0x58..0x5a].copy_from_slice(&[0x0b, 2]);
        assert_eq!(platforms(&pe), Some(vec![("windows", Some("aarch64"))]));
        // In a truncated file, nothing beyond its end may be read.
        for bytes in [&pe[..], &mach, &universal, &elf(2, 1, [62, 0]), b"#!/bin/sh\n"] {
            for length in 0..bytes.len() {
                assert_eq!(platforms(&bytes[..length]), None, "{length} of {bytes:?}");
            }
        }
        pe[0x3c..0x40].fill(0xff);
        assert_eq!(platforms(&pe), None);
        assert_eq!(platforms(b"\xca\xfe\xba\xbe\0\0\0\0"), None);
    }

    /// Compares with readelf, which belongs to the linker that linked this test.
    #[test]
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    fn the_needed_glibc_is_the_latest_required_version() {
        // The name of a later version is only a string, which requires nothing.
        let name = std::hint::black_box("GLIBC_2.99");
        let program = std::env::current_exe().unwrap();
        let bytes = std::fs::read(&program).unwrap();
        assert!(bytes.windows(name.len()).any(|window| window == name.as_bytes()));
        let mut readelf = std::process::Command::new("readelf");
        let printed = readelf.args(["--version-info", "--wide"]).arg(&program).output().expect("readelf");
        let printed = String::from_utf8(printed.stdout).unwrap();
        let versions = printed.split_whitespace().filter_map(|word| word.strip_prefix("GLIBC_2."));
        let minors = versions.filter_map(|version| version.split('.').next()?.parse::<u32>().ok());
        let latest = minors.max().expect("a version of glibc");
        assert!(latest < 99);
        let binaries = Binary::all(&bytes).unwrap();
        assert_eq!(binaries[0].needed_glibc(), Some((2, latest)));
        assert!(binaries[0].needed_libraries().iter().any(|library| library == "libc.so.6"));
    }
}
