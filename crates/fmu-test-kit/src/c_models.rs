//! Test FMUs in C: compiles the models in the directory `models`, and packs them with their descriptions.

use fmi_abi::write::zip;
use std::env::consts::DLL_SUFFIX;
use std::hash::{Hash as _, Hasher as _};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns a file of the directory `models`.
#[must_use]
pub fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("models").join(name)
}

/// Reads a file of the directory `models`, such as a model description.
///
/// # Panics
/// Panics if there is no such file.
#[must_use]
pub fn read(name: &str) -> String {
    std::fs::read_to_string(source(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Returns the path of the compiled library of a model, which all tests of a build share. A trait is selected when the library is
/// used, but C++ (`-xc++`) and faults in linking are flags of the compiler.
///
/// # Panics
/// Panics if the model does not compile.
#[must_use]
pub fn library(model: &str, flags: &[&str]) -> PathBuf {
    let mut hasher = std::hash::DefaultHasher::new();
    (read(&format!("{model}.c")), read("frame.h"), read("compiler-options.txt"), flags).hash(&mut hasher);
    let directory = std::env::current_exe().expect("a test").with_file_name("c_models");
    std::fs::create_dir_all(&directory).expect("a directory");
    let library = directory.join(format!("{model}-{:x}{DLL_SUFFIX}", hasher.finish()));
    if library.exists() {
        return library;
    }
    let new = tempfile::NamedTempFile::new_in(&directory).expect("a file");
    compile(model, flags, new.path());
    // Replaces the same library if another test has stored it meanwhile.
    new.persist(&library).expect("a file");
    library
}

/// Compiles a model to a shared library.
///
/// # Panics
/// Panics if the model does not compile.
pub fn compile(model: &str, flags: &[&str], library: &Path) {
    let [language, compiler, variable] =
        if flags.contains(&"-xc++") { ["-std=gnu++20", "c++", "CXX"] } else { ["-std=gnu11", "cc", "CC"] };
    let status = Command::new(std::env::var_os(variable).unwrap_or_else(|| compiler.into()))
        .arg(language)
        .arg(format!("@{}", source("compiler-options.txt").display()))
        .args(flags)
        .arg(source(&format!("{model}.c")))
        .arg("-o")
        .arg(library)
        // One of the integrator's traits is that the library uses functions of libm without being linked to it.
        .args((model != "integrator").then_some("-lm"))
        .arg("-lpthread")
        .status()
        .expect("these tests need a C compiler (cc, or set CC)");
    assert!(status.success(), "{model}.c does not compile");
}

/// Returns the path of a model's library in an FMU of this FMI version.
#[must_use]
pub fn binary(model: &str, fmi: u32) -> String {
    let system = if cfg!(target_os = "macos") { "darwin" } else { "linux" };
    let platform = match fmi {
        2 => format!("{system}64"),
        _ => format!("{}-{system}", std::env::consts::ARCH),
    };
    format!("binaries/{platform}/{model}{DLL_SUFFIX}")
}

/// Packs the FMU of a model with a description, its library and further files, as `MODEL.fmu` in a directory.
///
/// # Panics
/// Panics if the file cannot be written.
pub fn pack(
    directory: &Path,
    (model, fmi): (&str, u32),
    description: &str,
    library: &Path,
    files: &[(&str, &[u8])],
) -> PathBuf {
    let path = directory.join(format!("{model}.fmu"));
    let mut entries = vec![
        ("modelDescription.xml".to_owned(), description.into()),
        (binary(model, fmi), std::fs::read(library).expect("the library")),
    ];
    entries.extend(files.iter().map(|(name, content)| ((*name).to_owned(), content.to_vec())));
    std::fs::write(&path, zip(&entries).expect("a zip file")).expect("a file");
    path
}
