//! A compiled library: its platforms and its stamp.

use crate::platform::Platform;
use crate::signature::sign;
use anyhow::{Context, Result, ensure};
use fmi_abi::files::binaries::Binary;
use fmi_abi::stamp::{NO_GUID, Stamp};
use std::io::Read;
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// A compiled library.
#[derive(Clone, Debug)]
pub struct Library {
    /// The platform that it is for.
    pub platform: Platform,
    /// The content of its file.
    pub bytes: Vec<u8>,
    /// Its file, unless it comes from an FMU.
    path: Option<PathBuf>,
}

impl Library {
    /// A library that is not a file.
    pub fn new(platform: Platform, bytes: Vec<u8>) -> Self {
        Self { platform, bytes, path: None }
    }

    /// Returns the path of a file with the library, and with these start values. Writes one into `directory` unless the library's own file
    /// has them.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn file(&self, starts: &[(u32, f64)], directory: &Path) -> Result<PathBuf> {
        if let Some(path) = &self.path
            && stamp(&self.bytes)?.starts().eq(starts.iter().copied())
        {
            return Ok(path.clone());
        }
        let path = directory.join(format!("{}-{}", starts.len(), self.platform.library_name("varied")));
        let bytes = with_stamp(&self.bytes, NO_GUID, Some(starts))?;
        std::fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(path)
    }

    /// Reads a library, also from an FMU that contains it, and checks that it is for this platform (with `any_processor`, only for its
    /// operating system) and was compiled with fmu-export.
    ///
    /// # Errors
    /// When the file cannot be read or is another kind of file; the message contains the path.
    pub fn read(platform: Platform, path: &Path, any_processor: bool) -> Result<Self> {
        let is_fmu = path.extension().is_some_and(|suffix| suffix == "fmu");
        let bytes = if is_fmu { library_in(path, platform) } else { std::fs::read(path).map_err(Into::into) };
        let bytes =
            bytes.with_context(|| format!("cannot read {}, the library for {platform}", path.display()))?;
        let check = || {
            check_platform(&bytes, platform, any_processor)?;
            stamp(&bytes)
        };
        check().with_context(|| path.display().to_string())?;
        Ok(Self { platform, bytes, path: (!is_fmu).then(|| path.to_owned()) })
    }
}

/// Returns the library for a platform in an FMU.
fn library_in(fmu: &Path, platform: Platform) -> Result<Vec<u8>> {
    let mut archive = ZipArchive::new(std::fs::File::open(fmu)?)?;
    let is_library = |name: &String| {
        let mut parts = name.split('/');
        parts.next() == Some("binaries")
            && parts.next().and_then(|part| Platform::of_directory(part).ok()) == Some(platform)
    };
    let name = archive.file_names().flatten().map(|name| name.into_owned()).find(is_library);
    let mut bytes = Vec::new();
    archive.by_name(&name.context("it has none")?)?.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Returns the stamp of a library or of a WebAssembly module. The parts of a universal library must have the same.
pub fn stamp(library: &[u8]) -> Result<Stamp> {
    let positions = Stamp::positions(library);
    let mut stamps = positions.iter().map(|position| Stamp::read(library, *position));
    let has = |part: &str| library.windows(part.len()).any(|window| window == part.as_bytes());
    ensure!(
        has("fmi2Instantiate"),
        "it has no functions of FMI; its crate needs `export_fmu!(...)` in src/lib.rs (`offer!` makes none)"
    );
    let stamp = stamps.next().with_context(|| {
        let version = env!("CARGO_PKG_VERSION");
        format!("it has no place for the guid; compile it with the same version of fmu-export as fmu-package ({version})")
    })?;
    ensure!(
        stamps.all(|other| other.interface() == stamp.interface()),
        "its parts come from different models"
    );
    Ok(stamp)
}

/// Returns the library with this guid in its stamps; `starts` are also replaced if there are any. Signs a library for macOS again, because
/// its signature contains hashes of its content.
pub fn with_stamp(library: &[u8], guid: &str, starts: Option<&[(u32, f64)]>) -> Result<Vec<u8>> {
    let mut library = library.to_vec();
    for position in Stamp::positions(&library) {
        let stamp = Stamp::read(&library, position).with_guid(guid);
        let stamp = starts.map_or(stamp, |starts| stamp.with_starts(starts));
        stamp.write(&mut library, position);
    }
    sign(&mut library)?;
    Ok(library)
}

/// Returns the platforms of a library: one, or several if it is a universal library for macOS.
fn platforms(library: &[u8]) -> Result<Vec<Platform>> {
    const NONE: &str = "it is not a shared library";
    let binaries = Binary::all(library).ok().context(NONE)?;
    ensure!(binaries.iter().all(Binary::is_shared), NONE);
    let platform = |binary: &Binary| {
        let processor =
            binary.processor.context("it is for a processor for which FMI 2.0 has no directory")?;
        Platform::of(processor, binary.system)
    };
    binaries.iter().map(platform).collect()
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

#[cfg(test)]
mod tests {
    use super::check_platform;
    use crate::platform::Platform;

    /// Returns a universal library for macOS, whose parts have only a header.
    fn universal(processors: &[u32]) -> Vec<u8> {
        const HEADER: usize = 32;
        let mut bytes = [0xcafe_babe, processors.len() as u32].map(u32::to_be_bytes).concat();
        for (index, &processor) in processors.iter().enumerate() {
            let position = 8 + 20 * processors.len() + HEADER * index;
            bytes.extend([processor, 0, position as u32, HEADER as u32, 0].map(u32::to_be_bytes).concat());
        }
        for &processor in processors {
            // The fourth number is the kind of file, a library.
            bytes.extend([0xfeed_facf, processor, 0, 6, 0, 0, 0, 0].map(u32::to_le_bytes).concat());
        }
        bytes
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
    fn other_files_are_rejected() {
        for bytes in [&b""[..], b"\x7fELF", b"MZ", b"<html>", &[0xca, 0xfe, 0xba, 0xbe, 0, 0, 0, 9]] {
            let error = check(bytes, "linux64", false).unwrap_err();
            assert_eq!(error, "it is not a shared library", "{bytes:?}");
        }
    }
}
