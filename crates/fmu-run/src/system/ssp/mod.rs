//! SSP files (System Structure and Parameterization 1.0).

mod open;
mod parameters;
mod read;
mod routes;
mod source;
#[cfg(feature = "write")]
mod write;

pub(super) use read::{child, children, needed};
pub(super) use source::Base;

/// Type of the components that are FMUs.
const FMU: &str = "application/x-fmu-sharedlibrary";
