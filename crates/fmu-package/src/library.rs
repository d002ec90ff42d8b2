//! Reads a compiled library: its platforms, its guid and the version of glibc that it needs.

use crate::platform::Platform;
use crate::variant::NO_GUID;
use anyhow::{Context, Result, bail, ensure};
use object::read::macho::{FatArch, MachOFatFile32};
use object::{Architecture, BinaryFormat, File, FileKind, Object, ObjectKind, ObjectSection};
use std::path::Path;

/// Returns the platforms of a library: one, or several if it is a universal library for macOS.
fn platforms(library: &[u8]) -> Result<Vec<Platform>> {
    const NONE: &str = "it is not a shared library";
    match FileKind::parse(library).context(NONE)? {
        FileKind::MachOFat32 => {
            let parts = MachOFatFile32::parse(library).context(NONE)?;
            parts.arches().iter().map(|part| platform(part.architecture(), BinaryFormat::MachO)).collect()
        }
        FileKind::Elf32
        | FileKind::Elf64
        | FileKind::MachO32
        | FileKind::MachO64
        | FileKind::Pe32
        | FileKind::Pe64 => {
            let file = File::parse(library).context(NONE)?;
            ensure!(file.kind() == ObjectKind::Dynamic, NONE);
            Ok(vec![platform(file.architecture(), file.format())?])
        }
        _ => bail!(NONE),
    }
}

fn platform(architecture: Architecture, format: BinaryFormat) -> Result<Platform> {
    let architecture = match architecture {
        Architecture::X86_64 => "x86_64",
        Architecture::I386 => "x86",
        Architecture::Aarch64 => "aarch64",
        other => bail!("it is for the processor {other:?}, for which FMI 2.0 has no directory"),
    };
    let system = match format {
        BinaryFormat::Elf => "linux",
        BinaryFormat::Pe => "windows",
        BinaryFormat::MachO => "macos",
        other => bail!("it is a file in the format {other:?}, which no importer loads"),
    };
    Platform::of(architecture, system)
}

/// Checks that a library is for this platform; with `any_processor`, only that it is for the operating system of the platform.
pub fn check_platform(library: &[u8], wanted: Platform, any_processor: bool) -> Result<()> {
    let found = platforms(library)?;
    let names = || found.iter().map(Platform::to_string).collect::<Vec<_>>().join(" and ");
    let on_system = found.iter().any(|platform| platform.same_system(wanted));
    ensure!(on_system, "it is for {}, not for {wanted}", names());
    ensure!(
        any_processor || found.contains(&wanted),
        "it is for {}, not for {wanted}; if importers on any processor are to load it from there, add --any-processor",
        names()
    );
    Ok(())
}

/// Checks that a library has FMI functions and was compiled with this guid.
pub fn check_guid(library: &[u8], guid: &str, path: &Path) -> Result<()> {
    let has = |part: &str| library.windows(part.len()).any(|window| window == part.as_bytes());
    let path = path.display();
    ensure!(
        has(guid) || has("fmi2Instantiate"),
        "{path} has no functions of FMI; its crate needs `export_fmu!(...)` in src/lib.rs (`offer!` makes none)",
    );
    ensure!(
        has(guid) || !has(NO_GUID),
        "{path} has no guid: compile it with FMU_GUID={guid} in the environment, and let INFO begin with info!",
    );
    ensure!(
        has(guid),
        "{path} was not compiled from these sources and parameters (the guid {guid} is not in it); compile it again",
    );
    Ok(())
}

/// Returns the oldest version of glibc with which a library for Linux loads; `None` if it is not for Linux or does not use glibc.
pub fn needed_glibc(library: &[u8]) -> Option<(u32, u32)> {
    let file = File::parse(library).ok().filter(|file| file.format() == BinaryFormat::Elf)?;
    let strings = file.section_by_name(".dynstr")?.data().ok()?;
    let version = |name: &[u8]| {
        let mut numbers = std::str::from_utf8(name).ok()?.strip_prefix("GLIBC_")?.split('.');
        Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
    };
    strings.split(|byte| *byte == 0).filter_map(version).max()
}

#[cfg(test)]
mod tests {
    use super::{check_platform, needed_glibc};
    use crate::platform::Platform;

    /// Returns a universal library for macOS with empty parts.
    fn universal(processors: &[u32]) -> Vec<u8> {
        let mut numbers = vec![0xcafe_babe, processors.len() as u32];
        for &processor in processors {
            numbers.extend([processor, 0, 0x1000, 0, 12]);
        }
        numbers.iter().flat_map(|number: &u32| number.to_be_bytes()).collect()
    }

    fn check(library: &[u8], directory: &str, any_processor: bool) -> Result<(), String> {
        let wanted = Platform::of_directory(directory).unwrap();
        check_platform(library, wanted, any_processor).map_err(|error| error.to_string())
    }

    #[test]
    fn a_universal_library_is_for_each_of_its_processors() {
        let (intel, arm) = (0x0100_0007, 0x0100_000c);
        let both = universal(&[intel, arm]);
        assert_eq!(check(&both, "darwin64", false), Ok(()));
        assert_eq!(check(&both, "aarch64-darwin", false), Ok(()));
        let error = check(&both, "linux64", true).unwrap_err();
        assert_eq!(error, "it is for darwin64 and aarch64-darwin, not for linux64");
        let error = check(&universal(&[arm]), "darwin64", false).unwrap_err();
        assert!(error.contains("aarch64-darwin") && error.contains("--any-processor"), "{error}");
        assert_eq!(check(&universal(&[arm]), "darwin64", true), Ok(()));
    }

    #[test]
    fn a_program_is_for_its_machine_only() {
        let program = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        let host = Platform::host().unwrap().to_string();
        for directory in ["linux64", "win64", "darwin64"].into_iter().filter(|name| *name != host) {
            assert!(check(&program, directory, false).is_err(), "{directory}");
        }
    }

    #[test]
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    fn the_glibc_of_a_program_is_found() {
        let program = std::fs::read(std::env::current_exe().unwrap()).unwrap();
        // The standard library of Rust needs 2.17.
        assert!(needed_glibc(&program).is_some_and(|version| version >= (2, 17)));
        assert_eq!(needed_glibc(b"GLIBC_2.34"), None);
    }

    #[test]
    fn other_files_are_rejected() {
        for bytes in [&b""[..], b"\x7fELF", b"MZ", b"<html>", &[0xca, 0xfe, 0xba, 0xbe, 0, 0, 0, 9]] {
            let error = check(bytes, "linux64", false).unwrap_err();
            assert_eq!(error, "it is not a shared library", "{bytes:?}");
        }
    }
}
