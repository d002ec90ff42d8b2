//! The guid of an FMU of the testbed: a hash of all that its content follows from.
//!
//! The build script compiles it into the library, `build_fmu` writes it into the model description.

use crate::parameter_file::{ParameterSet, Value};
use anyhow::Context;
use fmi2_package::{ContentFile, Fingerprint, content_files};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// What the library and its description are made from; of folders, all Rust files.
const SOURCES: [&str; 9] = [
    "Cargo.lock",
    "Cargo.toml",
    "build.rs",
    "build_fmu.rs",
    "crates/fmi2-export/Cargo.toml",
    "crates/fmi2-export/src",
    "crates/fmi2-package/Cargo.toml",
    "crates/fmi2-package/src",
    "src",
];

/// The folder of what goes into the FMU.
const CONTENT: &str = "modelDescription";

/// What else goes into the FMU, as part of its licenses.
const LICENSES: [&str; 2] = ["LICENSE-APACHE", "LICENSE-MIT"];

/// In that folder, but not as it is: the description is written anew, the parameters are compiled in.
const NOT_CONTENT: [&str; 2] = ["modelDescription.xml", "parameters.json"];

/// The description of the FMU as it is built by default.
pub const DESCRIPTION: &str = "modelDescription/modelDescription.xml";

/// Table 1.
pub const PARAMETERS: &str = "modelDescription/parameters.json";

/// The files of the project that go into the FMU as they are.
///
/// # Errors
/// When a file has no place in an FMU or cannot be found.
pub fn fmu_content(project: &Path) -> anyhow::Result<Vec<ContentFile>> {
    let mut files = content_files(&project.join(CONTENT), &NOT_CONTENT)?;
    let license =
        |name| ContentFile { name: format!("documentation/licenses/{name}"), path: project.join(name) };
    files.extend(LICENSES.map(license));
    Ok(files)
}

/// A hash of the sources and of the files that go into the FMU as they are.
///
/// # Errors
/// When one of them cannot be read.
pub fn sources(project: &Path) -> anyhow::Result<String> {
    let mut fingerprint = Fingerprint::new();
    for source in SOURCES {
        add_all(&mut fingerprint, project, &project.join(source))?;
    }
    for file in fmu_content(project)? {
        add(&mut fingerprint, &file.name, &file.path)?;
    }
    Ok(fingerprint.guid())
}

fn add_all(fingerprint: &mut Fingerprint, project: &Path, path: &Path) -> anyhow::Result<()> {
    if path.is_dir() {
        let entries: Result<Vec<PathBuf>, io::Error> =
            fs::read_dir(path)?.map(|entry| Ok(entry?.path())).collect();
        let mut entries = entries?;
        entries
            .retain(|entry| entry.is_dir() || entry.extension().is_some_and(|extension| extension == "rs"));
        entries.sort();
        return entries.iter().try_for_each(|entry| add_all(fingerprint, project, entry));
    }
    // The same name on every system.
    let name: Vec<_> = path.strip_prefix(project)?.iter().map(|part| part.to_string_lossy()).collect();
    add(fingerprint, &name.join("/"), path)
}

fn add(fingerprint: &mut Fingerprint, name: &str, path: &Path) -> anyhow::Result<()> {
    fingerprint.add(name, &fs::read(path).with_context(|| format!("cannot read {}", path.display()))?);
    Ok(())
}

/// The guid of the FMU made from these sources with these parameters.
pub fn guid(sources: &str, parameters: &ParameterSet, tunable: bool) -> String {
    let mut fingerprint = Fingerprint::new();
    fingerprint.add("sources", sources.as_bytes());
    for (name, value) in parameters.iter() {
        match value {
            Value::Real(value) => fingerprint.add(name, &value.to_bits().to_le_bytes()),
            Value::Integer(value) => fingerprint.add(name, &value.to_le_bytes()),
        }
    }
    fingerprint.add("tunable", &[u8::from(tunable)]);
    fingerprint.guid()
}

/// What a build script must watch to run again whenever the hash changes.
///
/// # Errors
/// When the folder of the content cannot be read.
pub fn watched(project: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut paths: Vec<PathBuf> = SOURCES.iter().chain(&LICENSES).map(|name| project.join(name)).collect();
    for entry in fs::read_dir(project.join(CONTENT))? {
        let entry = entry?;
        if !NOT_CONTENT.iter().any(|name| entry.file_name() == *name) {
            paths.push(entry.path());
        }
    }
    paths.sort();
    Ok(paths)
}
