//! libFuzzer searches for systems and parameter files with which opening a system panics. The last byte of the input selects
//! which of the two files the other bytes replace.
#![no_main]

#[path = "../../../fmu-run/tests/readers/corpus.rs"]
#[allow(dead_code, reason = "only the files of a system are used")]
mod corpus;
#[path = "../../../fmu-run/tests/readers/harness.rs"]
#[allow(dead_code, reason = "each target uses one function")]
mod harness;

use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;
use tempfile::TempDir;

/// Directory of a system. Its FMU contains only a description, so that no library is loaded.
static DIRECTORY: LazyLock<TempDir> = LazyLock::new(|| {
    let directory = TempDir::new().expect("a directory");
    std::fs::create_dir(directory.path().join("m")).expect("a directory");
    let description = corpus::descriptions().remove(0).1;
    std::fs::write(directory.path().join("m/modelDescription.xml"), description).expect("a file");
    reset(directory.path());
    directory
});

/// Writes valid files of a system.
fn reset(directory: &std::path::Path) {
    let system = corpus::systems().into_iter().find(|(name, _)| *name == "parameters").expect("a system").1;
    std::fs::write(directory.join("SystemStructure.ssd"), system).expect("a file");
    std::fs::write(directory.join("p.ssv"), corpus::parameters().remove(0).1).expect("a file");
}

fuzz_target!(|bytes: &[u8]| {
    let Some((which, bytes)) = bytes.split_last() else { return };
    let names = ["SystemStructure.ssd", "p.ssv"];
    harness::file_of_system(DIRECTORY.path(), names[usize::from(*which) % 2], bytes);
    reset(DIRECTORY.path());
});
