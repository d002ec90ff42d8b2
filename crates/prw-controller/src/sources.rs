//! What the FMU of the controller is made from; its guid is a hash of that.

use fmu_package::Sources;

/// The files that the library and its description are made from; the folder is that of `Cargo.toml`.
pub fn sources(folder: &str) -> Sources {
    Sources { licenses: vec!["../../LICENSE-APACHE", "../../LICENSE-MIT"], ..Sources::of_package(folder) }
}
