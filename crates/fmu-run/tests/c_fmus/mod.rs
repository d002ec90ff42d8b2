//! Compiles C files to libraries of FMUs, and packs and opens the FMUs.

use fmi_abi::write::zip;
use fmu_run::{Fmu, Standard};
use fmu_test_kit::c_programs::headers;
use std::path::Path;
use std::process::Command;

/// Compiles a C file of the directory `tests` with this compiler and further flags. Returns the library.
pub fn compiled(source: &str, compiler: &str, flags: &[&str]) -> Vec<u8> {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(source);
    let directory = tempfile::tempdir().unwrap();
    let library = directory.path().join("library.so");
    let status = Command::new(compiler)
        .args(["-Wall", "-Wextra", "-Werror", "-O2", "-ffp-contract=off", "-shared", "-fPIC", "-I"])
        .arg(headers(&source))
        .args(flags)
        .arg(&source)
        .arg("-o")
        .arg(&library)
        .status();
    assert!(status.expect("these tests need a compiler for C and C++").success());
    std::fs::read(library).unwrap()
}

/// Packs an FMU into the file `path`: its model description, its library with this name, and further files.
pub fn pack(
    path: &Path,
    standard: Standard,
    description: String,
    (name, library): (&str, &[u8]),
    files: &[(&str, &[u8])],
) {
    let platform = if standard == Standard::Fmi2 { "linux64" } else { "x86_64-linux" };
    let mut entries = vec![
        (format!("binaries/{platform}/{name}.so"), library.to_vec()),
        ("modelDescription.xml".to_owned(), description.into_bytes()),
    ];
    entries.extend(files.iter().map(|(name, content)| ((*name).to_owned(), content.to_vec())));
    std::fs::write(path, zip(&entries).unwrap()).unwrap();
}

/// Opens an FMU of these tests.
pub fn open(path: &Path) -> Fmu {
    // SAFETY: the FMU of these tests.
    unsafe { Fmu::open(path) }.unwrap()
}
