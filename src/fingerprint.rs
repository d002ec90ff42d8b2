//! What the FMU of the testbed is made from; its guid is a hash of that.
//!
//! The build script compiles the guid into the library, `build_fmu` writes it into the model description.

use crate::parameter_file::{ParameterSet, Value};
use fmi2_package::{Sources, Start};
use std::path::PathBuf;

/// Table 1.
pub const PARAMETERS: &str = "modelDescription/parameters.json";

/// The files that the library and its description are made from.
pub fn sources(project: impl Into<PathBuf>) -> Sources {
    Sources {
        folder: project.into(),
        code: vec!["Cargo.toml", "build.rs", "build_fmu.rs", "src"],
        content: Some("modelDescription"),
        // The description is written anew, the parameters are compiled in.
        not_content: vec!["modelDescription.xml", "parameters.json"],
        licenses: vec!["LICENSE-APACHE", "LICENSE-MIT"],
    }
}

/// The start values that a set of parameters stands for.
pub fn start(parameters: &ParameterSet) -> Vec<(String, Start)> {
    let start = |value| match value {
        Value::Real(value) => Start::Real(value),
        Value::Integer(value) => Start::Integer(value),
    };
    parameters.iter().map(|(name, value)| (name.to_owned(), start(value))).collect()
}
