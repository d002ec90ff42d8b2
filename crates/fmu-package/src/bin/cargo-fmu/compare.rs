//! Compares the interface types of an FMU that was built.

use std::path::Path;
use std::time::SystemTime;

/// Compares the FMUs that were written since `begin` in a directory or in its subdirectory `fmi3`. Prints a warning if an FMU has
/// different results in Co-Simulation and Model Exchange.
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
