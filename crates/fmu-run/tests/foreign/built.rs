//! Packs the FMUs of `integrator.c`.

use fmu_run::{Fmu, Standard, System};
use fmu_test_kit::c_models::{library, pack, read};
use std::path::{Path, PathBuf};

/// Packs the FMU with this manner into a file in a directory. `changes` are replacements in its model description.
pub fn built(manner: &str, standard: Standard, directory: &Path, changes: &[(&str, &str)]) -> PathBuf {
    let fmi = if standard == Standard::Fmi2 { 2 } else { 3 };
    let mut xml = read(&format!("integrator{fmi}.xml")).replace("TRAITS", manner);
    for (from, to) in changes {
        assert!(xml.contains(from), "{from}");
        xml = xml.replace(from, to);
    }
    if manner == "once" {
        xml = xml.replace("<CoSimulation", "<CoSimulation canBeInstantiatedOnlyOncePerProcess=\"true\"");
    }
    let library = library("integrator", if manner == "exceptions" { &["-xc++"] } else { &[] });
    let files: &[(&str, &[u8])] = &[("resources/gain.txt", b"2.5")];
    pack(directory, ("integrator", fmi), &xml, &library, if manner == "null_resources" { &[] } else { files })
}

/// Packs and opens the FMU with this manner.
pub fn opened(manner: &str, standard: Standard) -> System {
    opened_with(manner, standard, &[]).system().clone()
}

/// Packs and opens the FMU with this manner and these replacements in its model description.
pub fn opened_with(manner: &str, standard: Standard, changes: &[(&str, &str)]) -> Fmu {
    let directory = tempfile::tempdir().unwrap();
    let path = built(manner, standard, directory.path(), changes);
    // SAFETY: the FMU of these tests.
    unsafe { Fmu::open(&path) }.unwrap()
}
