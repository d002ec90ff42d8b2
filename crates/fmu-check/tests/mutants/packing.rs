//! Compiles the test FMUs, which are written in C, once for all tests, and packs them for each test.

use std::hash::{Hash as _, Hasher as _};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use zip::write::SimpleFileOptions;

/// Returns the path of the compiled library of a model, which the tests share. An environment variable selects the faults when
/// the library is loaded, but a fault in linking needs a separate library, which is compiled with this macro.
pub fn library(model: &str, fmi: u32, macro_name: &str) -> PathBuf {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/mutants/{model}.c"));
    let mut hasher = std::hash::DefaultHasher::new();
    std::fs::read(&source).expect("the source").hash(&mut hasher);
    let name = format!("{model}-{fmi}{macro_name}-{:x}{}", hasher.finish(), std::env::consts::DLL_SUFFIX);
    let library = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    if library.exists() {
        return library;
    }
    let new = tempfile::NamedTempFile::new_in(env!("CARGO_TARGET_TMPDIR")).expect("a file");
    let status = Command::new(std::env::var_os("CC").unwrap_or_else(|| "cc".into()))
        .args(["-O1", "-shared", "-fPIC", &format!("-DFMI={fmi}")])
        .args((!macro_name.is_empty()).then(|| format!("-D{macro_name}")))
        .arg("-o")
        .args([new.path(), &source])
        .args(["-lm", "-lpthread"])
        .status()
        .expect("a C compiler");
    assert!(status.success(), "{model}.c does not compile");
    // Replaces the same library if another test has stored it meanwhile.
    new.persist(&library).expect("a file");
    library
}

/// Packs the FMU of a model with a description, its library and further files.
pub fn pack(
    directory: &Path,
    (model, fmi): (&str, u32),
    description: &str,
    library: &Path,
    files: &[(&str, &[u8])],
) -> PathBuf {
    let path = directory.join(format!("{model}.fmu"));
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&path).expect("a file"));
    let mut add = |name: &str, bytes: &[u8]| {
        zip.start_file(name, SimpleFileOptions::default()).expect("an entry");
        zip.write_all(bytes).expect("an entry");
    };
    add("modelDescription.xml", description.as_bytes());
    let system = if cfg!(target_os = "macos") { "darwin" } else { "linux" };
    let binaries = match fmi {
        2 => format!("{system}64"),
        _ => format!("{}-{system}", std::env::consts::ARCH),
    };
    let name = format!("binaries/{binaries}/{model}{}", std::env::consts::DLL_SUFFIX);
    add(&name, &std::fs::read(library).expect("the library"));
    files.iter().for_each(|(name, bytes)| add(name, bytes));
    zip.finish().expect("a ZIP");
    path
}
