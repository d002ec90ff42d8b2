//! An unpacked and loaded FMU.

use crate::description::{Description, Structural};
use crate::error::Error;
use crate::files::{Files, Kind};
use crate::library::Library;
use crate::platform;
use fmi_abi::description::Offer;
use fmi_abi::files::{Limits, find_library};
use fmi_abi::{Interface, Standard};
use std::error::Error as _;
use std::path::Path;
use std::sync::Arc;

/// Name of the file that contains the model description.
const DESCRIPTION: &str = "modelDescription.xml";

/// An unpacked and loaded FMU.
#[derive(Debug)]
pub(crate) struct Loaded {
    pub description: Arc<Description>,
    files: Arc<Files>,
    co_simulation: Option<Arc<Library>>,
    /// Library for Model Exchange, if the FMU has one. `Err` contains the reason why it cannot be loaded, although the library for
    /// Co-Simulation can.
    model_exchange: Result<Option<Arc<Library>>, String>,
}

impl Loaded {
    /// Opens an FMU. A zip file is unpacked within these limits.
    ///
    /// # Safety
    /// The requirement of [`Fmu::open`](crate::Fmu::open). If `execution_tool` is true, the FMU may also start another program.
    pub unsafe fn open(path: &Path, execution_tool: bool, limits: &mut Limits) -> Result<Self, Error> {
        let fail = |why: String| Error::Fmu(format!("{}: {why}", path.display()));
        let files = Files::open(path, Kind::Fmu, limits).map_err(fail)?;
        let description = files.xml(DESCRIPTION).and_then(|text| Description::parse(&text)).map_err(fail)?;
        let files = Arc::new(files);
        // SAFETY: the caller guarantees that the library is sound.
        let load = |offer: &Offer| unsafe { load(&files, description.standard, offer, execution_tool) };
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
        Ok(Self { description: Arc::new(description), files, co_simulation, model_exchange })
    }

    /// Returns the directory of the unpacked FMU.
    pub fn directory(&self) -> &Path {
        self.files.path()
    }

    /// Returns a copy of the FMU with these values of structural parameters, which change the sizes of arrays.
    pub fn configured(&self, structure: Vec<Structural>) -> Result<Self, Error> {
        let fail = |why: String| Error::Fmu(format!("{}: {why}", self.description.model_name));
        let description =
            self.files.xml(DESCRIPTION).and_then(|text| Description::parse_configured(&text, structure));
        Ok(Self {
            description: Arc::new(description.map_err(fail)?),
            files: Arc::clone(&self.files),
            co_simulation: self.co_simulation.clone(),
            model_exchange: self.model_exchange.clone(),
        })
    }

    /// Returns whether a process may create only one instance.
    pub fn once_per_process(&self, interface: Interface) -> bool {
        self.description.offer(interface).is_some_and(|offer| offer.once_per_process)
    }

    /// Returns the library for this interface type.
    pub fn library(&self, interface: Interface) -> Result<&Arc<Library>, Error> {
        let name = &self.description.model_name;
        match interface {
            Interface::CoSimulation => self.co_simulation.as_ref().ok_or_else(|| {
                Error::Fmu(format!(
                    "{name} has no Co-Simulation, only Model Exchange; `run` of this FMU integrates it, but in systems it is not supported"
                ))
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

/// Loads the library for an interface type.
///
/// # Safety
/// The requirement of [`Fmu::open`](crate::Fmu::open).
unsafe fn load(
    files: &Arc<Files>,
    standard: Standard,
    offer: &Offer,
    execution_tool: bool,
) -> Result<Arc<Library>, String> {
    if offer.needs_execution_tool && !execution_tool {
        let why = "it starts another program, which must be installed (needsExecutionTool); to run it all the same, \
            open it with execution_tool=True, in Rust with open_with_execution_tool";
        return Err(why.to_owned());
    }
    let file = find_library(files.path(), standard, &offer.identifier)?;
    let directory = files.path().join("resources");
    // Section 2.3.1 of FMI 3.0.2 requires NULL if the FMU has no resources. FMUs of FMI 2.0 may read the URI without checking for NULL.
    let has_resources = standard == Standard::Fmi2 || directory.is_dir();
    let resources = has_resources.then(|| standard.resources(&directory));
    // SAFETY: the caller guarantees that the library is sound.
    let loaded = unsafe { Library::load(&file, standard, resources, Arc::clone(files)) };
    loaded.map(Arc::new).map_err(|error| {
        // The error names the failed call; its source contains the reason.
        let why = platform::mismatch(&file).unwrap_or_else(|| match error.source() {
            Some(source) => format!("{error}: {source}"),
            None => error.to_string(),
        });
        format!("its library cannot be loaded: {why}")
    })
}
