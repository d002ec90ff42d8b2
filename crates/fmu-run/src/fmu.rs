//! An unpacked and loaded FMU.

use crate::description::{Description, Structural};
use crate::error::Error;
use crate::library::Library;
use crate::machine;
use fmi_abi::description::Offer;
use fmi_abi::{Interface, Standard};
use std::env::consts::{ARCH, DLL_SUFFIX, OS};
use std::error::Error as _;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tempfile::TempDir;

/// An unpacked and loaded FMU.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub description: Arc<Description>,
    directory: Arc<TempDir>,
    co_simulation: Option<Arc<Library>>,
    /// Library for Model Exchange, or the reason why it cannot be loaded although the library for
    /// Co-Simulation can.
    model_exchange: Result<Option<Arc<Library>>, String>,
}

impl Loaded {
    /// Opens an FMU.
    ///
    /// # Safety
    /// The requirement of [`Fmu::open`](crate::Fmu::open); if `execution_tool` is true, the program may be started.
    pub unsafe fn open(path: &Path, execution_tool: bool) -> Result<Self, Error> {
        let fail = |why: String| Error::Fmu(format!("{}: {why}", path.display()));
        let directory = unpacked(path).map_err(fail)?;
        let description =
            content(directory.path()).and_then(|text| Description::parse(&text)).map_err(fail)?;
        let directory = Arc::new(directory);
        // SAFETY: the caller guarantees that the library is sound.
        let load = |offer: &Offer| unsafe { load(&directory, description.standard, offer, execution_tool) };
        let co_simulation = description.co_simulation.as_ref().map(load).transpose().map_err(fail)?;
        let same = |offer: &&Offer| {
            description.co_simulation.as_ref().is_some_and(|own| own.identifier == offer.identifier)
        };
        let mut model_exchange = match &description.model_exchange {
            Some(offer) if same(&offer) => Ok(co_simulation.clone()),
            Some(offer) => load(offer).map(Some),
            None => Ok(None),
        };
        if co_simulation.is_none() {
            model_exchange = Ok(model_exchange.map_err(fail)?);
        }
        Ok(Self { description: Arc::new(description), directory, co_simulation, model_exchange })
    }

    /// Returns the FMU with other values of structural parameters.
    pub fn configured(&self, structure: Vec<Structural>) -> Result<Self, Error> {
        let fail = |why: String| Error::Fmu(format!("{}: {why}", self.description.model_name));
        let description =
            content(self.directory.path()).and_then(|text| Description::parse_configured(&text, structure));
        Ok(Self {
            description: Arc::new(description.map_err(fail)?),
            directory: Arc::clone(&self.directory),
            co_simulation: self.co_simulation.clone(),
            model_exchange: self.model_exchange.clone(),
        })
    }

    /// Returns whether a process may have only one instance.
    pub fn once_per_process(&self, interface: Interface) -> bool {
        self.description.offer(interface).is_some_and(|offer| offer.once_per_process)
    }

    /// Returns the library for this interface type.
    pub fn library(&self, interface: Interface) -> Result<&Arc<Library>, Error> {
        let name = &self.description.model_name;
        match interface {
            Interface::CoSimulation => self.co_simulation.as_ref().ok_or_else(|| {
                Error::Fmu(format!("{name} has no Co-Simulation, only Model Exchange, which needs a solver"))
            }),
            Interface::ModelExchange => match &self.model_exchange {
                Ok(library) => {
                    library.as_ref().ok_or_else(|| Error::Fmu(format!("{name} has no Model Exchange")))
                }
                Err(why) => Err(Error::Fmu(format!("{name}: {why}"))),
            },
        }
    }
}

/// Returns the model description of an unpacked FMU.
fn content(directory: &Path) -> Result<String, String> {
    std::fs::read_to_string(directory.join("modelDescription.xml"))
        .map_err(|_| "there is no readable modelDescription.xml in it; it is no FMU".to_owned())
}

/// Loads the library for an interface type.
///
/// # Safety
/// The requirement of [`Fmu::open`](crate::Fmu::open).
unsafe fn load(
    directory: &Arc<TempDir>,
    standard: Standard,
    offer: &Offer,
    execution_tool: bool,
) -> Result<Arc<Library>, String> {
    if offer.needs_execution_tool && !execution_tool {
        let why = "it starts another program, which must be installed (needsExecutionTool); to run it all the same, \
            open it with execution_tool=True, in Rust with open_with_execution_tool";
        return Err(why.to_owned());
    }
    let file = library_of(directory.path(), standard, offer)?;
    let resources = standard.resources(&directory.path().join("resources"));
    // SAFETY: the caller guarantees that the library is sound.
    let loaded = unsafe { Library::load(&file, standard, resources, Arc::clone(directory)) };
    loaded.map(Arc::new).map_err(|error| {
        // The loader's error names the failed call; its source gives the reason.
        let why = machine::mismatch(&file).unwrap_or_else(|| match error.source() {
            Some(source) => format!("{error}: {source}"),
            None => error.to_string(),
        });
        format!("its library cannot be loaded: {why}")
    })
}

pub(crate) fn unpacked(path: &Path) -> Result<TempDir, String> {
    let file = File::open(path).map_err(|error| format!("cannot be opened ({error})"))?;
    let mut archive =
        zip::ZipArchive::new(file).map_err(|error| format!("is no FMU, which is a zip file ({error})"))?;
    let directory = tempfile::Builder::new()
        .prefix("fmu-run-")
        .tempdir()
        .map_err(|error| format!("no temporary directory can be made ({error})"))?;
    // `extract` rejects entries that would leave the directory.
    archive.extract(directory.path()).map_err(|error| format!("cannot be unpacked ({error})"))?;
    Ok(directory)
}

/// Returns the directories of `binaries/` that may contain a library for this machine. The names of FMI 2.0
/// do not contain the processor; many FMUs for ARM use them nevertheless.
fn directories(standard: Standard) -> Vec<String> {
    let system = if OS == "macos" { "darwin" } else { OS };
    let tuple = format!("{ARCH}-{system}");
    let short = match (system, usize::BITS) {
        ("windows", bits) => format!("win{bits}"),
        (system, bits) => format!("{system}{bits}"),
    };
    match (standard, ARCH) {
        (Standard::Fmi3, _) => vec![tuple],
        (Standard::Fmi2, "x86_64" | "x86") => vec![short, tuple],
        (Standard::Fmi2, _) => vec![tuple, short],
    }
}

fn library_of(directory: &Path, standard: Standard, offer: &Offer) -> Result<PathBuf, String> {
    let name = format!("{}{DLL_SUFFIX}", offer.identifier);
    let directories = directories(standard);
    let binaries = directory.join("binaries");
    if let Some(found) =
        directories.iter().map(|directory| binaries.join(directory).join(&name)).find(|path| path.is_file())
    {
        return Ok(found);
    }
    let mut others: Vec<_> = std::fs::read_dir(&binaries)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    others.sort();
    let others = if others.is_empty() { "none".to_owned() } else { others.join(", ") };
    Err(format!("has no library for this platform (binaries/{}/{name}); it has: {others}", directories[0]))
}
