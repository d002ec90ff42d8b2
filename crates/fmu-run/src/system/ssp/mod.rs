//! SSP files (System Structure and Parameterization 1.0).

mod read;
mod source;
#[cfg(feature = "write")]
mod write;

/// Type of the components that are FMUs.
const FMU: &str = "application/x-fmu-sharedlibrary";
