//! Compares the interface types of an FMU that was built.

use std::path::Path;
use std::time::SystemTime;

/// Prints a warning for each FMU in a directory, and in its directory for FMI 3.0, that was written since `begin` and whose
/// Co-Simulation and Model Exchange have different results.
pub fn warn(directory: &Path, begin: SystemTime) {
    let directories = [directory.to_owned(), directory.join("fmi3")];
    let entries = directories.iter().filter_map(|of| std::fs::read_dir(of).ok()).flatten().flatten();
    for path in entries.map(|entry| entry.path()) {
        let is_new = path.metadata().and_then(|of| of.modified()).is_ok_and(|time| time >= begin);
        if !is_new || path.extension().is_none_or(|end| end != "fmu") {
            continue;
        }
        // An FMU that cannot be read is a finding of `cargo fmu check`, not of the comparison.
        if let Ok(Some(difference)) = fmu_check::compare_interfaces(&path) {
            eprintln!(
                "warning: {}: Co-Simulation and Model Exchange differ: {difference}; cargo fmu check has the calls",
                path.display()
            );
        }
    }
}
