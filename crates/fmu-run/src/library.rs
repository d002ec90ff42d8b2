//! The shared library of an FMU, loaded as long as an object uses it.

use fmi_abi::c_types::c_void;
use fmi_abi::{Standard, fmi2, fmi3};
use std::ffi::CString;
use std::path::Path;
use std::sync::Arc;
use tempfile::TempDir;

/// A loaded library, with the files of its FMU.
#[derive(Debug)]
pub(crate) struct Library {
    pub functions: Functions,
    /// Location of its resources, as importers write it.
    pub resources: CString,
    _loaded: libloading::Library,
    // Removed after the library is unloaded.
    _directory: Arc<TempDir>,
}

/// Functions of the library, for one FMI version.
#[derive(Debug)]
pub(crate) enum Functions {
    Fmi2(Box<fmi2::Functions>),
    Fmi3(Box<fmi3::Functions>),
}

impl Library {
    /// Loads a library. Functions of an unsupported interface type may be missing; calls of missing functions
    /// return errors.
    ///
    /// # Safety
    /// The file is the library of an FMU of this FMI version. Its functions have the types of the FMI
    /// standard, and the library is sound when it is loaded and called.
    ///
    /// # Errors
    /// Fails if the library cannot be loaded, or lacks the function that frees instances.
    pub unsafe fn load(
        path: &Path,
        standard: Standard,
        resources: CString,
        directory: Arc<TempDir>,
    ) -> Result<Self, libloading::Error> {
        // SAFETY: the caller guarantees that loading is sound.
        let loaded = unsafe { libloading::Library::new(path) }?;
        // SAFETY: the symbol is only looked up.
        let symbol = |name: &str| unsafe { loaded.get::<*const c_void>(name) }.map(|found| *found);
        // SAFETY: the caller guarantees that the functions have the types of the FMI standard.
        let functions = unsafe {
            match standard {
                Standard::Fmi2 => {
                    symbol("fmi2FreeInstance")?;
                    Functions::Fmi2(Box::new(fmi2::Functions::find(|name| symbol(name).ok())))
                }
                Standard::Fmi3 => {
                    symbol("fmi3FreeInstance")?;
                    Functions::Fmi3(Box::new(fmi3::Functions::find(|name| symbol(name).ok())))
                }
            }
        };
        Ok(Self { functions, resources, _loaded: loaded, _directory: directory })
    }
}
