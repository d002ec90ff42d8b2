//! Checks the ZIP file, its directories, and the names, architectures and dependencies of the libraries.

use crate::description::{Description, Offer};
use crate::rules::Observation;
use anyhow::bail;
use fmi_abi::files::binaries::Binary;
use fmi_abi::files::{self, Entry, Limits};
use fmi_abi::{Standard, shown};
use std::collections::HashSet;
use std::env::consts::{ARCH, OS};
use std::path::{Path, PathBuf};

/// Unpacks an FMU, and returns the findings in its ZIP file.
///
/// # Errors
/// Fails if the FMU cannot be unpacked, if its files have more than `max_bytes`, or if the user interrupts the check.
pub fn unpack(path: &Path, directory: &Path, max_bytes: u64) -> anyhow::Result<Vec<Observation>> {
    let mut found = Vec::new();
    let mut names = HashSet::new();
    let mut limits = Limits { bytes: max_bytes, ..Limits::default() };
    let unpacked = files::unpack(path, "an FMU", directory, &mut limits, &mut |entry| {
        check_entry(entry, &mut names, &mut found);
        if crate::worker::interrupted() { Err("interrupted".to_owned()) } else { Ok(true) }
    });
    if crate::worker::interrupted() {
        return Err(crate::run::Stop::Interrupted.into());
    }
    match unpacked {
        Ok(()) => Ok(found),
        Err(why) if why.contains("MB when it is unpacked") => {
            bail!(
                "{}: {why}; if it is meant to be so large, raise the limit with --unpacked MB",
                path.display()
            )
        }
        Err(why) => bail!("{}: {why}", path.display()),
    }
}

/// Checks an entry of a ZIP file. `names` are the paths of the earlier entries, in lower case.
fn check_entry(entry: &Entry, names: &mut HashSet<String>, found: &mut Vec<Observation>) {
    let name = entry.name;
    let mut add = |rule: &'static str, observed: String| found.push((rule, observed));
    if !entry.is_inside || name.contains('\\') {
        add("package.paths", shown(name).into_owned());
    }
    if let Some(compression) = &entry.compression {
        add("package.compression", format!("{} is compressed by {compression}", shown(name)));
    }
    // Tools unpack equal paths to the same file, no matter how they are written.
    let path = name.replace('\\', "/").to_lowercase();
    let parts: Vec<_> = path.split('/').filter(|part| !part.is_empty() && *part != ".").collect();
    if !names.insert(parts.join("/")) {
        add("package.names", shown(name).into_owned());
    }
}

/// Returns the path of the library for this platform.
///
/// # Errors
/// Fails if the FMU has no library for this platform, or if that library is for another processor or cannot be read.
pub fn library(directory: &Path, standard: Standard, offer: &Offer) -> Result<PathBuf, String> {
    let library =
        files::find_library(directory, standard, &offer.identifier).map_err(|why| format!("it {why}"))?;
    let bytes = std::fs::read(&library).map_err(|error| error.to_string())?;
    let binaries = Binary::all(&bytes).unwrap_or_default();
    match binaries.iter().find_map(|binary| binary.processor) {
        Some(other) if other != ARCH && OS != "macos" => {
            let path = library.strip_prefix(directory).unwrap_or(&library).display();
            Err(format!("{path} is for {other}, but this machine is {ARCH}"))
        }
        _ => Ok(library),
    }
}

/// Returns the names that a library exports for this processor; `None` if they cannot be read.
pub fn exported(library: &Path) -> Option<Vec<String>> {
    let bytes = std::fs::read(library).ok()?;
    let binaries = Binary::all(&bytes).ok()?;
    binaries.iter().find(|binary| binary.processor == Some(ARCH))?.exports()
}

/// Checks the directories in `binaries/` and the libraries in them.
pub fn look(directory: &Path, description: &Description) -> Vec<Observation> {
    let mut found = Vec::new();
    let mut add = |name: &'static str, observed: String| found.push((name, observed));
    // Names of directories that only FMI 2.0 defines.
    let fmi2_names: &[&str] = match description.standard {
        Standard::Fmi2 => &["win32", "win64", "linux32", "linux64", "darwin32", "darwin64"],
        Standard::Fmi3 => &[],
    };
    let platforms = std::fs::read_dir(directory.join("binaries")).into_iter().flatten().flatten();
    for platform in platforms.filter(|entry| entry.path().is_dir()) {
        let name = platform.file_name().to_string_lossy().into_owned();
        let tuple = name.split_once('-');
        if description.standard == Standard::Fmi3 && tuple.is_none() {
            add("package.platforms", format!("binaries/{name}"));
        }
        let extensions = [("darwin", ".dylib"), ("win", ".dll"), ("", ".so")];
        let extension = extensions.into_iter().find(|(system, _)| name.contains(system));
        let extension = extension.map_or("", |(_, extension)| extension);
        let is_fmi2 = fmi2_names.contains(&name.as_str());
        let standard_directory =
            (tuple.is_some() || is_fmi2) && (description.standard == Standard::Fmi2) == is_fmi2;
        for offer in [&description.co_simulation, &description.model_exchange].into_iter().flatten() {
            let file = platform.path().join(format!("{}{extension}", offer.identifier));
            if standard_directory && !file.is_file() {
                let observed = format!("binaries/{name} has no {}{extension}", offer.identifier);
                add("package.library", observed);
            }
        }
        for file in std::fs::read_dir(platform.path()).into_iter().flatten().flatten() {
            check_library(&file.path(), &name, &mut add);
        }
    }
    found.dedup();
    found
}

/// Prefixes of the names of system libraries on Linux, Windows and macOS.
const SYSTEM_LIBRARIES: &str = "libc.so libm.so libdl.so libpthread.so librt.so libgcc_s.so libstdc++.so ld-linux libutil.so \
    kernel32 kernelbase ntdll msvcrt api-ms-win user32 advapi32 ws2_32 shell32 ole32 bcrypt shlwapi ucrtbase \
    /usr/lib/ /system/library/";

/// Checks the architecture of a library, and the libraries, symbols and glibc version that it needs.
fn check_library(path: &Path, platform: &str, add: &mut impl FnMut(&'static str, String)) {
    let Ok(bytes) = std::fs::read(path) else { return };
    // A universal library is only for macOS.
    let binaries = Binary::all(&bytes).unwrap_or_default();
    let [binary] = &binaries[..] else { return };
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let Some(machine) = binary.processor_in_fmi3() else { return };
    // A directory with a non-standard name may have libraries for any architecture.
    let wanted = match (platform, platform.split_once('-')) {
        ("linux64" | "win64", _) => &["x86_64", "aarch64"][..],
        ("linux32" | "win32", _) => &["x86", "aarch32"],
        (_, Some((architecture, "linux" | "windows"))) => &[architecture],
        _ => &[machine],
    };
    if !wanted.contains(&machine) {
        add("package.machine", format!("binaries/{platform}/{name} is for {machine}"));
    }
    // Systems that are some years old do not have a later glibc.
    if let Some((major, minor)) = binary.needed_glibc().filter(|version| *version > (2, 28)) {
        add("package.glibc", format!("binaries/{platform}/{name} needs glibc {major}.{minor}"));
    }
    let libraries = binary.needed_libraries();
    let directory = path.parent().unwrap_or(path);
    let is_system = |library: &str| {
        let lower = library.to_lowercase();
        SYSTEM_LIBRARIES.split_whitespace().any(|known| lower.starts_with(known)) || lower.is_empty()
    };
    let foreign: Vec<&str> = libraries
        .iter()
        .map(String::as_str)
        .filter(|library| !is_system(library) && !directory.join(library).exists())
        .collect();
    let unversioned = binary.unversioned_symbols();
    if libraries.iter().all(|library| is_system(library)) && !unversioned.is_empty() {
        let list = unversioned.join(", ");
        let observed = format!(
            "binaries/{platform}/{name} needs the symbols {list}, which no library that it links to provides"
        );
        add("package.symbols", observed);
    }
    if !foreign.is_empty() {
        add("package.needs", format!("binaries/{platform}/{name} needs {}", foreign.join(", ")));
    }
}

#[cfg(test)]
mod tests {
    use super::{Entry, check_entry};
    use std::collections::HashSet;

    #[test]
    fn paths_of_entries_differ() {
        let (mut names, mut found) = (HashSet::new(), Vec::new());
        let different = ["a/", "a/b", "a.b", "ab", "b/a"];
        for name in different.into_iter().chain(["a/b", "./ab", "b//a", "A.b", "b/./a"]) {
            check_entry(&Entry { name, is_inside: true, compression: None }, &mut names, &mut found);
        }
        let repeated: Vec<_> = found.iter().map(|(rule, name)| (*rule, name.as_str())).collect();
        assert_eq!(repeated, ["a/b", "./ab", "b//a", "A.b", "b/./a"].map(|name| ("package.names", name)));
    }
}
