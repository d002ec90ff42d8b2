//! Finds the platform for which a library was built, from the headers of the file.

use fmi_abi::files::binaries::Binary;
use std::env::consts::{ARCH, OS};
use std::path::Path;

/// If a library is for another platform, returns a message that names its platform and this one.
pub(crate) fn mismatch(library: &Path) -> Option<String> {
    let bytes = std::fs::read(library).ok()?;
    let binaries = Binary::all(&bytes).ok()?;
    let system = binaries.first()?.system;
    let processors: Vec<&str> = binaries.iter().map(|binary| binary.processor).collect::<Option<_>>()?;
    let fits = system == OS && processors.contains(&ARCH);
    (!fits).then(|| {
        let (for_system, here) = (name(system), name(OS));
        format!("it is for {for_system} on {}, and this is {here} on {ARCH}", processors.join(" and "))
    })
}

/// Returns the usual name of an operating system.
fn name(system: &str) -> &str {
    match system {
        "linux" => "Linux",
        "macos" => "macOS",
        "windows" => "Windows",
        other => other,
    }
}
