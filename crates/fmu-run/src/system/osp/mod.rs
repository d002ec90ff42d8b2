//! Systems of the Open Simulation Platform, as libcosim reads them: a directory with `OspSystemStructure.xml` and the FMUs.

mod read;
#[cfg(feature = "write")]
mod write;

/// File that contains the structure of the system.
pub(super) const STRUCTURE: &str = "OspSystemStructure.xml";
