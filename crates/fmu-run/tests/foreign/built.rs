//! Packs the FMUs of `integrator.c`.

use fmu_run::{Fmu, Standard, System};
use fmu_test_kit::c_models::{library, pack, read};
use std::path::{Path, PathBuf};

/// Packs the FMU with this manner into a file in a directory. `changes` are replacements in its model description.
pub fn built(manner: &str, standard: Standard, directory: &Path, changes: &[(&str, &str)]) -> PathBuf {
    let fmi = if standard == Standard::Fmi2 { 2 } else { 3 };
    let mut xml = changed(&read(&format!("integrator{fmi}.xml")).replace("TRAITS", manner), changes);
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

/// Packs and opens the FMU whose parameter `behaviour` selects how its runs end, with these replacements in its model description. For
/// FMI 2.0, it lacks the functions of optional capabilities.
pub fn misbehaving(standard: Standard, changes: &[(&str, &str)]) -> Fmu {
    let (fmi, flags) = if standard == Standard::Fmi2 { (2, &["-DMINIMAL"][..]) } else { (3, &[][..]) };
    let xml = changed(&read(&format!("misbehaving{fmi}.xml")), changes);
    let directory = tempfile::tempdir().unwrap();
    let path = pack(directory.path(), ("integrator", fmi), &xml, &library("integrator", flags), &[]);
    // SAFETY: the FMU of these tests.
    unsafe { Fmu::open(&path) }.unwrap()
}

/// Returns a model description with these replacements.
fn changed(xml: &str, changes: &[(&str, &str)]) -> String {
    changes.iter().fold(xml.to_owned(), |xml, (from, to)| {
        assert!(xml.contains(from), "{from}");
        xml.replace(from, to)
    })
}
