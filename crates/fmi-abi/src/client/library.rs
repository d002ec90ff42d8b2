//! The shared library of an FMU. It stays loaded as long as an instance uses it.

use super::float::keeping_environment;
use crate::c_types::c_void;
use crate::{Standard, fmi2, fmi3};
use std::path::Path;

/// Functions of an FMU, with the library that contains them.
#[derive(Debug)]
pub struct Library {
    pub(crate) functions: Functions,
    _loaded: Option<libloading::Library>,
}

/// Functions of an FMU, for one FMI version.
#[derive(Clone, Debug)]
pub enum Functions {
    /// Functions of FMI 2.0.
    Fmi2(Box<fmi2::Functions>),
    /// Functions of FMI 3.0.
    Fmi3(Box<fmi3::Functions>),
}

impl Library {
    /// Loads a library. Functions of interface types that the FMU does not support may be missing; calls of missing functions return
    /// errors.
    ///
    /// # Safety
    /// The file is the library of an FMU of this FMI version. Its functions have the types of the FMI standard, and it is sound to
    /// load the library and to call them.
    ///
    /// # Errors
    /// Fails if the library cannot be loaded, or lacks the function that frees instances.
    pub unsafe fn load(path: &Path, standard: Standard) -> Result<Self, libloading::Error> {
        provide_symbols();
        // SAFETY: the caller guarantees that loading is sound.
        let loaded = keeping_environment(|| unsafe { libloading::Library::new(path) })?;
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
        Ok(Self { functions, _loaded: Some(loaded) })
    }

    /// Uses functions that are already in this process.
    ///
    /// # Safety
    /// The functions belong to an FMU, and it is sound to call them. They stay loaded as long as the returned value and its instances
    /// exist.
    pub unsafe fn of(functions: Functions) -> Self {
        Self { functions, _loaded: None }
    }

    /// Returns the FMI version.
    pub fn standard(&self) -> Standard {
        match self.functions {
            Functions::Fmi2(_) => Standard::Fmi2,
            Functions::Fmi3(_) => Standard::Fmi3,
        }
    }
}

/// Makes the symbols of libm, libdl and libpthread visible to all libraries, because many FMUs use them but are not linked to these
/// libraries. Such an FMU can only be loaded if its importer has loaded them.
#[cfg(target_os = "linux")]
fn provide_symbols() {
    use libloading::os::unix::{Library, RTLD_GLOBAL, RTLD_LAZY};
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        for name in ["libm.so.6", "libdl.so.2", "libpthread.so.0"] {
            // SAFETY: a system library, which most processes have loaded already.
            if let Ok(library) = unsafe { Library::open(Some(name), RTLD_LAZY | RTLD_GLOBAL) } {
                // Keeps the library loaded.
                std::mem::forget(library);
            }
        }
    });
}

/// Does nothing, because on Windows and macOS each imported symbol names its library.
#[cfg(not(target_os = "linux"))]
fn provide_symbols() {}
