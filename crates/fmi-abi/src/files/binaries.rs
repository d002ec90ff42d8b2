//! Finds the library of an FMU for this platform.

use crate::{Standard, shown};
use std::env::consts::{ARCH, DLL_SUFFIX, OS};
use std::path::{Path, PathBuf};

/// Returns the names of the directories in `binaries/` that may contain a library for this platform. FMI 2.0 has no names for ARM.
/// Some FMUs for ARM use the names of FMI 3.0, others the names of FMI 2.0, such as `linux64`, so both are tried.
fn directories(standard: Standard) -> Vec<String> {
    let system = if OS == "macos" { "darwin" } else { OS };
    let tuple = format!("{ARCH}-{system}");
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
