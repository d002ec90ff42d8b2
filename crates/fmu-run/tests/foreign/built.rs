//! Compiles and packs the FMUs of `foreign.c`.

use crate::c_fmus::{compiled, open, pack};
use fmu_run::{Fmu, Standard, System};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Returns the library, compiled once as C and once as C++.
fn library(is_cpp: bool) -> &'static [u8] {
    static COMPILED: [OnceLock<Vec<u8>>; 2] = [const { OnceLock::new() }; 2];
    let (compiler, language) = if is_cpp { ("c++", "c++") } else { ("cc", "c") };
    COMPILED[usize::from(is_cpp)].get_or_init(|| compiled("foreign/foreign.c", compiler, &["-x", language]))
}

/// Packs the FMU with this manner into a file in a directory. `changes` are replacements in its model description.
pub fn built(manner: &str, standard: Standard, directory: &Path, changes: &[(&str, &str)]) -> PathBuf {
    let xml = if standard == Standard::Fmi2 { "foreign2.xml" } else { "foreign3.xml" };
    let xml = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign").join(xml);
    let mut xml = std::fs::read_to_string(xml).unwrap().replace("MANNER", manner);
    for (from, to) in changes {
        assert!(xml.contains(from), "{from}");
        xml = xml.replace(from, to);
    }
    if manner == "once" {
        xml = xml.replace("<CoSimulation", "<CoSimulation canBeInstantiatedOnlyOncePerProcess=\"true\"");
    }
    let path = directory.join(format!("{manner}.fmu"));
    let gain: (&str, &[u8]) = ("resources/gain.txt", b"2.5");
    let files = if manner == "null_resources" { &[][..] } else { &[gain] };
    pack(&path, standard, xml, ("foreign", library(manner == "exceptions")), files);
    path
}

/// Packs and opens the FMU with this manner.
pub fn opened(manner: &str, standard: Standard) -> System {
    opened_with(manner, standard, &[]).system().clone()
}

/// Packs and opens the FMU with this manner and these replacements in its model description.
pub fn opened_with(manner: &str, standard: Standard, changes: &[(&str, &str)]) -> Fmu {
    let directory = tempfile::tempdir().unwrap();
    open(&built(manner, standard, directory.path(), changes))
}
