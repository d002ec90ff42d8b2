//! What every model is: [`Model`]. What else it can do, it says by a [capability](crate::capabilities).

use crate::info::Info;
use crate::log::Log;
use crate::table::Variables;
use fmi_abi::Interface;
use std::fmt;
use std::path::PathBuf;

/// A model that can be exported as an FMU.
///
/// A model is a struct with the values of its inputs, parameters and states, a [table](crate::variables) that says
/// which variable lives where, and equations. This crate does the rest: the C interface, the order of calls, the
/// checks, the log, the saved states. A model needs no `unsafe` and no value references.
///
/// What the model can do besides having values, it says by implementing a capability and naming it in
/// [`export_fmu!`](crate::export_fmu): [`CoSimulation`](crate::CoSimulation), [`ModelExchange`](crate::ModelExchange),
/// [`Partials`](crate::Partials), [`InputDerivatives`](crate::InputDerivatives),
/// [`OutputDerivatives`](crate::OutputDerivatives).
///
/// A saved state is a clone of the model; instances and saved states go from thread to thread.
///
/// # What happens when
///
/// | call of the importer | what the model sees |
/// |---|---|
/// | instantiate, reset | [`new`](Self::new) |
/// | set inputs, states, start values of outputs | the value in its place, and the `then` of the table; [`calculate_start`](Self::calculate_start) after each, until the model has stepped |
/// | set parameters | the same on a copy, then [`update`](Self::update) once; the copy takes the model's place if that succeeds |
/// | enter initialization | [`initialize`](Self::initialize) on a copy likewise; refused while a start value that was refused has not been set to another |
/// | read | [`calculate`](Self::calculate), if anything was set or stepped since the last time; then the `by` of the table |
/// | step | [`CoSimulation::step_at_once`](crate::CoSimulation::step_at_once); [`step`](crate::CoSimulation::step) if that returns false |
/// | event | [`ModelExchange::event`](crate::ModelExchange::event) |
/// | enter Continuous-Time Mode | [`ModelExchange::continuous_time_entered`](crate::ModelExchange::continuous_time_entered) |
/// | save, restore | `clone_from` |
/// | de-serialize | on a copy, the values of the places and memory of the table; then [`restored`](Self::restored) and [`update`](Self::update) |
pub trait Model: Variables + Clone + Send + Sync {
    /// The facts about the model.
    const INFO: Info;

    /// The model with its start values: those of the description are read from what this makes.
    ///
    /// # Errors
    /// When it cannot be made; the importer gets no instance, and the message.
    fn new(setup: &Setup) -> Result<Self, Error>;

    /// Called after parameters have changed, once for all that one call of the importer changes, or because a state
    /// was read from bytes: checks what concerns several values and prepares what depends on them. Ranges of single
    /// parameters have been checked.
    ///
    /// Many importers, FMPy among them, set one parameter a call: a pair of values that fits must be reached over pairs
    /// that fit as well.
    ///
    /// Not called after inputs, states or start values of outputs have been set.
    ///
    /// # Errors
    /// When the values do not fit together. The change is then undone and the importer told.
    fn update(&mut self) -> Result<(), Error> {
        Ok(())
    }

    /// Called after a state was read from bytes, before [`update`](Self::update): checks what the table's `memory` has
    /// brought, which knows no ranges, and prepares what depends on it.
    ///
    /// # Errors
    /// When the model is never like that. The bytes are then refused.
    fn restored(&mut self) -> Result<(), Error> {
        Ok(())
    }

    /// Called after each value that is set, until the model has stepped or Continuous-Time Mode was entered: calculates the
    /// states whose start is [`calculated`](crate::Variable::calculated). It is called as well if the importer has set
    /// states, and until the next step after a state was read from bytes: the model remembers whether they still follow.
    #[inline]
    fn calculate_start(&mut self) {}

    /// Called when the initialization begins, with all that was set before. More may be set until it ends.
    ///
    /// # Errors
    /// When the model cannot start there. It is then as it was before.
    fn initialize(&mut self, _experiment: &Experiment) -> Result<(), Error> {
        Ok(())
    }

    /// Calculates what several variables share, once after each change of values, state or time (s), before any of
    /// them is read.
    #[inline]
    fn calculate(&mut self, _time: f64) {}

    /// The model's messages to the user, if it has any: a [`Log`] among its fields. What is in a log that this does
    /// not hand out is never delivered.
    #[inline]
    fn log(&mut self) -> Option<&mut Log> {
        None
    }
}

/// What a model is made for.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Who integrates.
    pub interface: Interface,
    /// The name of the instance.
    pub instance_name: String,
    /// Where the FMU was unpacked, as the importer says it; see [`resources`](Self::resources).
    pub resource_location: Option<String>,
}

impl Setup {
    /// For a model outside of any importer, in tests.
    pub fn new(interface: Interface) -> Self {
        Self { interface, instance_name: String::new(), resource_location: None }
    }

    /// The folder `resources` of the unpacked FMU. `None` if the importer names none, or no file of this machine.
    ///
    /// FMI 3.0 has a path here, FMI 2.0 a URI, which importers write as `file:/`, `file:///` or `file:////`, with
    /// `localhost` or without, with `%20` for spaces or not, or as a path. Another host's folder is one on Windows
    /// only.
    pub fn resources(&self) -> Option<PathBuf> {
        resources(self.resource_location.as_deref()?, cfg!(windows))
    }
}

fn resources(location: &str, windows: bool) -> Option<PathBuf> {
    if location.trim().is_empty() {
        return None;
    }
    // A path, which may have a colon anywhere: no scheme has a separator in it (section 3.1 of RFC 3986), or is as
    // short as a drive.
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
        // file://C:/folder, which some write
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

/// What the importer says about the experiment (section 2.1.6).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Experiment {
    /// Start time, s.
    pub start_time: f64,
    /// Stop time, s, if the importer knows it; no step goes beyond it.
    pub stop_time: Option<f64>,
    /// Relative tolerance, if the importer has one.
    pub tolerance: Option<f64>,
}

/// Why a model cannot do what it was asked for, in a sentence that says what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error(String);

impl Error {
    /// An error with this message.
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
    use super::resources;
    use std::path::Path;

    #[test]
    fn resources_are_found_however_they_are_written() {
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
