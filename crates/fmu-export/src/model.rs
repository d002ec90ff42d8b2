//! [`Model`], the trait that every model implements. A model implements further traits for its
//! [capabilities](crate::capabilities).

use crate::info::Info;
use crate::log::Log;
use crate::table::Variables;
use fmi_abi::Interface;
use std::fmt;
use std::path::{Path, PathBuf};

/// A model that can be exported as an FMU.
///
/// A model consists of a [table](crate::variables) that defines a struct with the values of its inputs, parameters and
/// states, or maps variables to the fields of another struct, and of equations. This crate provides the C interface, checks the order of
/// calls and the values, and takes care of the log and of saved states. So a model needs no `unsafe` and no value references.
///
/// A model implements capabilities and names them in [`export_fmu!`](crate::export_fmu):
/// [`CoSimulation`](crate::CoSimulation), [`ModelExchange`](crate::ModelExchange),
/// [`Partials`](crate::Partials), [`InputDerivatives`](crate::InputDerivatives),
/// [`OutputDerivatives`](crate::OutputDerivatives).
///
/// A saved state is a clone of the model. Instances and saved states can move between threads.
///
/// # Calls of the importer and their effect on the model
///
/// | call of the importer | effect on the model |
/// |---|---|
/// | instantiate, reset | [`new`](Self::new) |
/// | set inputs, states, start values of outputs | sets the field and runs the `then` of the table; until the first step or Continuous-Time Mode, also calls [`calculate_start`](Self::calculate_start) |
/// | set parameters | as above, then [`update`](Self::update) once; an error undoes the change |
/// | enter initialization | [`initialize`](Self::initialize), undone after an error. If a start value was rejected and not set again, the importer gets an error and the model is not called |
/// | get | [`calculate`](Self::calculate), if a value, the state or the time has changed since its last call; then the `by` of the table |
/// | step | [`CoSimulation::step`](crate::CoSimulation::step), after [`FastSteps`](crate::FastSteps) if the model has them; an error undoes it |
/// | event | [`ModelExchange::event`](crate::ModelExchange::event); an error undoes it |
/// | enter Continuous-Time Mode | [`ModelExchange::continuous_time_entered`](crate::ModelExchange::continuous_time_entered) |
/// | save, restore | `clone` or `clone_from` |
/// | de-serialize | sets the fields and the memory of the table in a copy of the model, then calls its [`restored`](Self::restored) and [`update`](Self::update) |
pub trait Model: Variables + Clone + Send + Sync {
    /// General data of the model.
    const INFO: Info;

    /// Creates the model with its start values. The start values of the description are read from this model. A model that
    /// implements [`Default`], as a struct in the table does, needs this function only if values depend on the setup or
    /// on each other. A model that has neither does not compile:
    ///
    /// ```compile_fail,E0080
    /// use fmu_export::*;
    ///
    /// #[derive(Clone)]
    /// struct Plant {
    ///     u: f64,
    /// }
    ///
    /// variables! { for Plant;
    ///     /// Input
    ///     u = input(&NUMBER) in u;
    /// }
    ///
    /// impl Model for Plant {
    ///     const INFO: Info = info!("Plant", "plant");
    /// }
    ///
    /// let plant = Plant::new(&Setup::new(Interface::CoSimulation));
    /// ```
    ///
    /// # Errors
    /// Fails if the model cannot be created. The importer then gets the message instead of an instance.
    fn new(_setup: &Setup) -> Result<Self, Error> {
        let start = const { Self::START.expect("a model without Model::new must implement Default") };
        Ok(start())
    }

    /// Checks conditions between several values and updates fields that depend on parameters. This crate calls it once
    /// after each call of the importer that changes parameters, and after [`restored`](Self::restored). At that time,
    /// the range of each single parameter has already been checked.
    ///
    /// Many importers, for example FMPy, set one parameter per call. So if a condition relates two parameters, an
    /// importer must be able to get from one valid pair of values to another by changing one parameter at a time,
    /// with only valid pairs in between.
    ///
    /// This crate does not call this function after inputs, states or start values of outputs have been set.
    ///
    /// # Errors
    /// Fails if the values are inconsistent. The change is then undone, and the importer gets the message.
    fn update(&mut self) -> Result<(), Error> {
        Ok(())
    }

    /// Checks the `memory` of the table after a de-serialization, because this crate cannot check its range, and
    /// updates fields that depend on it. This crate also calls the function when it undoes some failed steps (see
    /// [`ATOMIC_STEP`](crate::CoSimulation::ATOMIC_STEP)), and always calls [`update`](Self::update) next.
    ///
    /// # Errors
    /// Fails if the state is impossible for the model. The bytes are then rejected.
    fn restored(&mut self) -> Result<(), Error> {
        Ok(())
    }

    /// Calculates the states whose start value is [`calculated`](crate::Variable::calculated). This crate calls it
    /// whenever a value is set, until the first step or Continuous-Time Mode. The importer may already have
    /// set the states itself. A de-serialized state may have been saved after the first step; this crate then calls the
    /// function again until the next step. In both cases the states must not change, so the model must remember whether they are
    /// still to be calculated.
    #[inline]
    fn calculate_start(&mut self) {}

    /// Prepares the model for the start of the simulation, after the importer has entered Initialization
    /// Mode. The importer may set further values before it leaves this mode.
    ///
    /// # Errors
    /// Fails if the model cannot start with these values. This crate then undoes the call, so the function may fail
    /// after it has changed the model.
    fn initialize(&mut self, _experiment: &Experiment) -> Result<(), Error> {
        Ok(())
    }

    /// Calculates values on which several variables depend. If values, the state or the time (s) have changed, this
    /// crate calls it once before the next value is read. This crate also calls the function before each iteration of
    /// an event.
    #[inline]
    fn calculate(&mut self, _time: f64) {}

    /// Returns the log of the model: a [`Log`] among its fields, or `None`. Only messages in this log are delivered.
    #[inline]
    fn log(&mut self) -> Option<&mut Log> {
        None
    }
}

/// Data from which a model is created.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Interface type: Co-Simulation or Model Exchange.
    pub interface: Interface,
    /// Name of the instance.
    pub instance_name: String,
    /// Location of the resources, as the importer passes it; see [`resources`](Self::resources).
    pub resource_location: Option<String>,
}

impl Setup {
    /// Creates the setup for a model without an importer, for tests.
    pub fn new(interface: Interface) -> Self {
        Self { interface, instance_name: String::new(), resource_location: None }
    }

    /// Returns the directory `resources` of the unpacked FMU; `None` if the importer passes no location, or one that
    /// is not a local directory.
    ///
    /// FMI 3.0 passes a path. FMI 2.0 passes a URI, but importers differ in how they write it: with `file:/`,
    /// `file:///` or `file:////`, with or without `localhost`, with or without `%20` for spaces, or as a path. A
    /// directory on another host is accepted only on Windows.
    pub fn resources(&self) -> Option<PathBuf> {
        resources(self.resource_location.as_deref()?, cfg!(windows))
    }

    /// Returns the path of a file in the directory `resources`. In the Cargo package of the
    /// model, the file is in `modelDescription/resources`.
    ///
    /// # Errors
    /// Fails if [`resources`](Self::resources) returns `None`, or if the name is not a plain file name.
    pub fn resource(&self, name: &str) -> Result<PathBuf, Error> {
        if name.contains(['/', '\\', ':']) || name.starts_with('.') {
            return Err(Error::new(format!(
                "{name:?} must be the name of a file in the directory resources"
            )));
        }
        let directory = self.resources().ok_or_else(|| {
            Error::new(format!(
                "there is no directory with {name:?}: the package must have modelDescription/resources, a test must call \
                 Simulation::with_resources, and the importer must pass the location of the resources"
            ))
        })?;
        Ok(directory.join(name))
    }
}

/// Reads a file in the directory of [`Setup::resources`]. Unlike `std::fs`, this function also works in a browser,
/// where the page that runs the FMU provides the files.
///
/// # Errors
/// Fails if the file cannot be read.
pub fn read_resource(path: impl AsRef<Path>) -> std::io::Result<Vec<u8>> {
    #[cfg(target_family = "wasm")]
    let content = crate::files::read(path.as_ref());
    #[cfg(not(target_family = "wasm"))]
    let content = std::fs::read(path);
    content
}

fn resources(location: &str, windows: bool) -> Option<PathBuf> {
    if location.trim().is_empty() {
        return None;
    }
    // The location is a URI only if a scheme precedes its first colon. A scheme contains no path separator (section
    // 3.1 of RFC 3986) and is longer than a drive letter; otherwise the location is a path.
    let is_scheme = |scheme: &str| scheme.len() > 1 && !scheme.contains(['/', '\\']);
    let Some((scheme, rest)) = location.split_once(':').filter(|(scheme, _)| is_scheme(scheme)) else {
        return Some(location.into());
    };
    if !scheme.eq_ignore_ascii_case("file") {
        return None;
    }
    let is_drive = |path: &str| matches!(path.as_bytes(), [letter, b':', ..] if letter.is_ascii_alphabetic());
    let rest = percent_decoded(rest);
    let (host, path) = match rest.strip_prefix("//") {
        // Some importers write file://C:/folder.
        Some(path) if is_drive(path) => ("", path),
        Some(rest) => rest.split_at(rest.find('/').unwrap_or(rest.len())),
        None => ("", rest.as_str()),
    };
    let local = path.trim_start_matches('/');
    if !(host.is_empty() || host.eq_ignore_ascii_case("localhost")) {
        return windows.then(|| format!("//{host}{path}").into());
    }
    // file:///C:/folder
    if is_drive(local) {
        return Some(local.into());
    }
    // file:////host/folder
    Some(if windows && path.starts_with("//") { format!("//{local}") } else { format!("/{local}") }.into())
}

fn percent_decoded(text: &str) -> String {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, tail @ ..] = rest {
        let code = tail.get(..2).filter(|_| *first == b'%').and_then(|code| std::str::from_utf8(code).ok());
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &tail[2..];
            }
            None => {
                bytes.push(*first);
                rest = tail;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Data of the experiment that the importer passes (section 2.1.6 of FMI 2.0).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Experiment {
    /// Start time, s.
    pub start_time: f64,
    /// Stop time, s, if the importer sets it; no step goes beyond it.
    pub stop_time: Option<f64>,
    /// Relative tolerance, if the importer sets it.
    pub tolerance: Option<f64>,
}

/// Reason why a model cannot do what the importer requests, as a sentence that names a remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error(String);

impl Error {
    /// Creates an error with this message.
    pub fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Error {}

#[cfg(test)]
mod tests {
    use super::{Setup, resources};
    use fmi_abi::Interface;
    use std::path::Path;

    #[test]
    fn resources_are_found_in_every_notation() {
        for (location, path) in [
            ("file:///tmp/a%20b/resources", "/tmp/a b/resources"),
            ("file:/tmp/resources", "/tmp/resources"),
            ("FILE:////tmp/100%/r", "/tmp/100%/r"),
            ("file://localhost/tmp/r", "/tmp/r"),
            ("file:///C:/temp/r", "C:/temp/r"),
            ("file://C:/temp/r", "C:/temp/r"),
            ("/tmp/no scheme", "/tmp/no scheme"),
            ("/tmp/a:b/100%20/", "/tmp/a:b/100%20/"),
            ("C:\\temp\\r", "C:\\temp\\r"),
            ("\\\\server\\a:b", "\\\\server\\a:b"),
        ] {
            assert_eq!(resources(location, false).as_deref(), Some(Path::new(path)), "{location}");
        }
        let elsewhere = ["file://localhostname/tmp/r", "file://server/share/r"];
        for location in ["", " ", "fmi2://elsewhere/r", "https://a/b"].into_iter().chain(elsewhere) {
            assert_eq!(resources(location, false), None, "{location}");
        }
    }

    #[test]
    fn a_resource_is_a_file_of_the_fmu() {
        let mut setup = Setup::new(Interface::CoSimulation);
        let error = |setup: &Setup, name| setup.resource(name).unwrap_err().to_string();
        assert!(error(&setup, "a.csv").starts_with("there is no directory with \"a.csv\": "));
        setup.resource_location = Some("/tmp/r".to_owned());
        assert_eq!(setup.resource("a.csv").as_deref(), Ok(Path::new("/tmp/r/a.csv")));
        for name in ["../a.csv", "/a.csv", "C:a.csv", "..\\a.csv", ".."] {
            assert!(error(&setup, name).ends_with("must be the name of a file in the directory resources"));
        }
    }

    #[test]
    fn resources_on_other_hosts_are_for_windows() {
        for (location, path) in [
            ("file://localhostname/share/r", "//localhostname/share/r"),
            ("file://server/share/a%20b", "//server/share/a b"),
            ("file:////server/share/r", "//server/share/r"),
            ("file:////C:/temp/r", "C:/temp/r"),
            ("file://localhost/C:/temp/r", "C:/temp/r"),
        ] {
            assert_eq!(resources(location, true).as_deref(), Some(Path::new(path)), "{location}");
        }
    }
}
