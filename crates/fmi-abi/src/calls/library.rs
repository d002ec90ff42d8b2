//! The library of an FMU.

use super::functions::Functions;
use crate::c_types::c_void;
use crate::{Standard, fmi2, fmi3};
pub use libloading::Error as LoadError;
use std::path::Path;

/// Functions of an FMU, with the library that contains them. It stays loaded as long as this value exists.
#[derive(Debug)]
pub struct Library {
    functions: Functions,
    loaded: Option<libloading::Library>,
}

impl Library {
    /// Loads a library. Missing functions are replaced by functions that return errors.
    ///
    /// # Safety
    /// It is sound to load the library, which may run any code, and to call its functions as the FMI standard allows. They have the types
    /// of the standard. Safe code relies on this, because [`client`](crate::client) calls the functions.
    ///
    /// # Errors
    /// Fails if the library cannot be loaded.
    pub unsafe fn load(path: &Path, standard: Standard) -> Result<Self, LoadError> {
        // SAFETY: the caller guarantees that loading is sound.
        let loaded = unsafe { libloading::Library::new(path) }?;
        let symbol = |name: &str| find(&loaded, name).ok();
        // SAFETY: the caller guarantees that the functions have the types of the FMI standard.
        let functions = unsafe {
            match standard {
                Standard::Fmi2 => Functions::Fmi2(Box::new(fmi2::Functions::find(symbol))),
                Standard::Fmi3 => Functions::Fmi3(Box::new(fmi3::Functions::find(symbol))),
            }
        };
        Ok(Self { functions, loaded: Some(loaded) })
    }

    /// Uses functions that are already in this process.
    ///
    /// # Safety
    /// The functions belong to an FMU, and it is sound to call them as the FMI standard allows. They stay loaded as long as the returned
    /// value exists.
    pub unsafe fn of(functions: Functions) -> Self {
        Self { functions, loaded: None }
    }

    /// Returns the functions.
    #[inline]
    pub fn functions(&self) -> &Functions {
        &self.functions
    }

    /// Returns the address of a symbol.
    ///
    /// # Errors
    /// Fails if the library lacks the symbol, or no library was loaded.
    pub fn find(&self, name: &str) -> Result<*const c_void, LoadError> {
        find(self.loaded.as_ref().ok_or(LoadError::DlSymUnknown)?, name)
    }

    /// Returns a function that is not part of FMI, as a function pointer.
    ///
    /// # Safety
    /// `F` is the type of a pointer to the function, and the library stays loaded while the function is used.
    ///
    /// # Errors
    /// Fails if the library lacks the function.
    pub unsafe fn function<F: Copy>(&self, name: &str) -> Result<F, LoadError> {
        const { assert!(size_of::<F>() == size_of::<*const c_void>()) };
        let address = self.find(name)?;
        // SAFETY: the caller guarantees the type, and the address is not 0.
        Ok(unsafe { std::mem::transmute_copy(&address) })
    }
}

/// Returns the address of a symbol. A symbol can also have the address 0, for example if it is weak and undefined; it then counts as
/// missing.
fn find(library: &libloading::Library, name: &str) -> Result<*const c_void, LoadError> {
    // SAFETY: the symbol is only used as an address.
    let found = unsafe { library.get::<*const c_void>(name) }.map(|found| *found)?;
    if found.is_null() { Err(LoadError::DlSymUnknown) } else { Ok(found) }
}

/// Makes the symbols of libm, libdl and libpthread visible to all libraries, because many FMUs use them but are not linked to these
/// libraries. Such an FMU can only be loaded if its importer has loaded them.
#[cfg(target_os = "linux")]
pub fn provide_symbols() {
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
pub fn provide_symbols() {}
