//! What the FMU of the testbed is made from; its guid is a hash of that.
//!
//! `build_fmu` compiles the guid into the library and writes it into the model description.

use crate::parameters::{Parameters, table};
use fmu_package::Sources;
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

macro_rules! start {
    ($($(#[$_meaning:meta])* $name:ident: $kind:ident $_compare:tt $_limit:literal, $_unit:literal;)+) => {
        /// The start values that a set of parameters stands for, to the last digit.
        pub fn start(parameters: &Parameters) -> Vec<(String, String)> {
            vec![$((stringify!($name).to_owned(), parameters.$name.to_string())),+]
        }
    };
}
table!(start);
