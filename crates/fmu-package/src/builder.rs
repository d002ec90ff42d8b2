//! The settings for building the FMUs of a model.

use crate::connectors::Terminal;
use crate::sources::Sources;
use crate::stages::{Page, passed_checker};
use fmi_abi::Standard;
use std::path::PathBuf;

/// The settings for building a model's FMUs.
#[derive(Clone, Debug)]
pub struct Builder {
    /// The package of the model: `env!("CARGO_PKG_NAME")`.
    pub package: String,
    /// The command that starts this program, to which messages append options.
    pub command: &'static str,
    /// The package of the model, and the files that the FMU contains unchanged.
    pub sources: Sources,
    /// FMI versions of the FMUs that are built by default. The committed model description is for the first of them.
    pub fmi: Vec<Standard>,
    /// The terminals of the FMU for FMI 3.0.
    pub terminals: Vec<Terminal>,
    /// Settings of cargo for this build, such as `profile.release.lto=false`.
    pub settings: Vec<String>,
    /// Start values that replace the start values of the compiled model: the variable's name and the value, for example `0.5`, `true`, or
    /// the number of an item. They are written into the compiled library, so the library need not be compiled again.
    pub start: Vec<(String, String)>,
    /// Label in messages for a build with other parameter values than the default ones. `None` for the default values, whose
    /// description is kept with the sources.
    pub variant: Option<String>,
    /// Additions to the page that runs the FMU.
    pub page: Page,
    /// The program cargo-fmu, which checks each FMU before it gets its name. `None` packs without this check. `cargo fmu build` passes its
    /// own path, also to the build program of a package.
    pub checker: Option<PathBuf>,
}

impl Builder {
    /// Returns the settings for a package in the usual layout, whose program is started with `cargo run --bin build_fmu`.
    ///
    /// Pass `env!("CARGO_PKG_NAME")` and its [directory](crate::directory_of).
    pub fn new(package: impl Into<String>, directory: impl Into<PathBuf>) -> Self {
        Self {
            package: package.into(),
            command: "cargo run --bin build_fmu --",
            sources: Sources::of_package(directory),
            fmi: vec![Standard::Fmi2, Standard::Fmi3],
            terminals: Vec::new(),
            settings: Vec::new(),
            start: Vec::new(),
            variant: None,
            page: Page::default(),
            checker: passed_checker(),
        }
    }
}
