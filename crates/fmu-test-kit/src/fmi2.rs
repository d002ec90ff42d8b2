//! FMI 2.0: an instance as an importer uses it.

use crate::importer::{Arguments, Log, Message, importer};
pub use fmi_abi::fmi2::Functions;
use fmi_abi::fmi2::types::*;
use fmu_export::{Standard, Status};
use std::ffi::CStr;
use std::ptr::null_mut;

fmi_abi::fmi2_functions!(importer, fmi2FreeInstance;);

/// Functions that exist only in FMI 2.0.
#[allow(clippy::missing_panics_doc, reason = "the functions are for tests and panic on purpose")]
impl Importer {
    /// Returns the version and the platform of the library; both functions need no instance (section 2.1.4 of FMI 2.0).
    pub fn version_and_platform(&self) -> [&CStr; 2] {
        let Functions { fmi2GetVersion, fmi2GetTypesPlatform, .. } = self.functions;
        // SAFETY: both functions return strings that stay valid while the library is loaded.
        [fmi2GetVersion, fmi2GetTypesPlatform].map(|function| unsafe { CStr::from_ptr(function()) })
    }

    /// Calls `fmi2SetDebugLogging` with these categories.
    pub fn set_debug_logging(&self, on: bool, categories: &[&CStr]) -> Status {
        let pointers: Vec<_> = categories.iter().map(|category| category.as_ptr()).collect();
        self.fmi2SetDebugLogging(on.into(), pointers.len(), pointers.as_ptr())
    }
}
