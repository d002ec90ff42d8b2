//! Compiles and packs the FMUs of `foreign.c`.

use fmu_run::{Fmu, Standard, System};
use fmu_test_kit::c_programs::headers;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use tempfile::TempDir;
use zip::write::SimpleFileOptions;

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign")
}

/// Returns the library, compiled once per language, `c` or `c++`.
fn library(language: &'static str) -> &'static Path {
    static COMPILED: [OnceLock<(TempDir, PathBuf)>; 2] = [const { OnceLock::new() }; 2];
    let (_, path) = COMPILED[usize::from(language == "c++")].get_or_init(|| {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("foreign.so");
        let compiler = if language == "c++" { "c++" } else { "cc" };
        let flags = ["-Wall", "-Wextra", "-Werror", "-O2", "-shared", "-fPIC", "-x", language];
        let source = source().join("foreign.c");
        let status = Command::new(compiler)
            .args(flags)
            .arg("-I")
            .arg(headers(&source))
            .arg(&source)
            .arg("-o")
            .arg(&path)
            .status();
        assert!(status.expect("these tests need a compiler for C and C++").success());
        (directory, path)
    });
    path
}

/// Packs the FMU with this manner into a file in a directory. `changes` are replacements in its model description.
pub fn built(manner: &str, standard: Standard, directory: &Path, changes: &[(&str, &str)]) -> PathBuf {
    let (xml, platform) = match standard {
        Standard::Fmi2 => ("foreign2.xml", "linux64"),
        Standard::Fmi3 => ("foreign3.xml", "x86_64-linux"),
    };
    let mut xml = std::fs::read_to_string(source().join(xml)).unwrap().replace("MANNER", manner);
    for (from, to) in changes {
        assert!(xml.contains(from), "{from}");
        xml = xml.replace(from, to);
    }
    if manner == "once" {
        xml = xml.replace("<CoSimulation", "<CoSimulation canBeInstantiatedOnlyOncePerProcess=\"true\"");
    }
    let path = directory.join(format!("{manner}.fmu"));
    let library = library(if manner == "exceptions" { "c++" } else { "c" });
    let mut entries = vec![
        ("modelDescription.xml".to_owned(), xml.into_bytes()),
        (format!("binaries/{platform}/foreign.so"), std::fs::read(library).unwrap()),
    ];
    if manner != "null_resources" {
        entries.push(("resources/gain.txt".to_owned(), b"2.5".to_vec()));
    }
    packed(&path, entries);
    path
}

/// Packs a zip file.
pub fn packed(path: &Path, entries: impl IntoIterator<Item = (String, Vec<u8>)>) {
    let mut archive = zip::ZipWriter::new(File::create(path).unwrap());
    for (name, content) in entries {
        archive.start_file(name, SimpleFileOptions::default()).unwrap();
        archive.write_all(&content).unwrap();
    }
    archive.finish().unwrap();
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
