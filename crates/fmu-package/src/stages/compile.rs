//! Compiles the libraries, and loads the model from the library for this machine.

use super::Plan;
use crate::c_sources::{LINKING, WEBASSEMBLY};
use crate::cargo::LibraryBuild;
use crate::library::{Library, check_platform, stamp, with_stamp};
use crate::model::LoadedModel;
use crate::platform::Platform;
use crate::starts::indexed_starts;
use anyhow::{Context, Result, ensure};
use fmi_abi::stamp::NO_GUID;
use std::fs;
use std::path::Path;
use tempfile::TempDir;

/// The directory of the files that the model reads.
const RESOURCES: &str = "modelDescription/resources";

/// The libraries of a model, and the model.
pub(crate) struct Compiled {
    pub model: LoadedModel,
    /// The start values that the libraries do not have from their compilation: index in the table and value.
    pub starts: Vec<(u32, f64)>,
    /// The library for this machine, with the start values.
    pub own: Library,
    /// The libraries to pack, with the start values.
    pub libraries: Vec<Library>,
    /// The WebAssembly module from which C sources are made, if they are.
    pub module: Option<Vec<u8>>,
    /// Contains the loaded library.
    pub directory: TempDir,
    /// Without the lock, another build could overwrite the library of this one.
    _lock: Option<fs::File>,
}

/// Returns the libraries to pack: the libraries of `--binary`, and one compiled for each target. If there are neither, compiles one for
/// this machine, which is not packed if only a description or C sources are requested. Writes the start values into all of them.
///
/// # Errors
/// When a library cannot be compiled or loaded, or is of another model.
pub(crate) fn compile(plan: &Plan) -> Result<Compiled> {
    let lock = lock(&plan.target);
    let mut libraries = libraries(plan)?;
    let host = Platform::host()?;
    let is_own = |library: &&Library| check_platform(&library.bytes, host, false).is_ok();
    let own = match libraries.iter().find(is_own) {
        Some(library) => library.clone(),
        None => Library::read(host, &plan.build().run()?, false)?,
    };
    if libraries.is_empty() && plan.description.is_none() && plan.wasm2c.is_none() {
        libraries.push(own.clone());
    }
    let directory = tempfile::tempdir_in(&plan.target).context("cannot make a temporary directory")?;
    let (model, starts) = load(plan, &own, directory.path())?;
    let own_stamp = stamp(&own.bytes)?;
    for library in &mut libraries {
        ensure!(
            stamp(&library.bytes)?.interface() == own_stamp.interface(),
            "the library for {} has other variables than the model: it was compiled from other sources; compile it again",
            library.platform
        );
        library.bytes = with_stamp(&library.bytes, NO_GUID, Some(&starts))?;
    }
    let own = Library::new(host, with_stamp(&own.bytes, NO_GUID, Some(&starts))?);
    let module = plan.wasm2c.is_some().then(|| module(plan)).transpose()?;
    Ok(Compiled { model, starts, own, libraries, module, directory, _lock: lock })
}

/// Waits until no other build runs in the same workspace, and returns a lock that lasts until the file is closed. Returns `None` if the
/// lock file cannot be created or locked; the build then continues without a lock.
fn lock(directory: &Path) -> Option<fs::File> {
    fs::create_dir_all(directory).ok()?;
    let file = fs::File::create(directory.join(".fmu-package.lock")).ok()?;
    file.lock().ok()?;
    Some(file)
}

/// Reads the libraries of `--binary`, and compiles one for each target.
fn libraries(plan: &Plan) -> Result<Vec<Library>> {
    let mut libraries = Vec::new();
    for (platform, path) in &plan.binaries {
        libraries.push(Library::read(*platform, path, plan.any_processor)?);
    }
    for (platform, target) in &plan.targets {
        let path = LibraryBuild { target: Some(target), ..plan.build() }.run()?;
        libraries.push(Library::read(*platform, &path, plan.any_processor)?);
    }
    Ok(libraries)
}

/// Loads the model from the library for this machine. Returns it with the start values that the library does not have from its
/// compilation.
fn load(plan: &Plan, own: &Library, directory: &Path) -> Result<(LoadedModel, Vec<(u32, f64)>)> {
    let with_starts = |starts: &[(u32, f64)]| {
        let path = own.file(starts, directory)?;
        let resources = plan.builder.sources.directory.join(RESOURCES);
        // SAFETY: the library contains a stamp of fmu-export. Cargo has just compiled it from the author's model, or the author names
        // it as the library of that model.
        #[allow(unsafe_code)]
        unsafe {
            LoadedModel::load_within(&path, Some(&resources), Some(plan.time_limit))
        }
    };
    let model = with_starts(&[])?;
    let starts = indexed_starts(&model.table, &plan.builder.start)?;
    Ok(if starts.is_empty() { (model, starts) } else { (with_starts(&starts)?, starts) })
}

/// Compiles the model to the WebAssembly module from which C sources are made.
fn module(plan: &Plan) -> Result<Vec<u8>> {
    let path = LibraryBuild { target: Some(WEBASSEMBLY), arguments: &LINKING, ..plan.build() }.run()?;
    fs::read(&path).with_context(|| format!("cannot read {}", path.display()))
}
