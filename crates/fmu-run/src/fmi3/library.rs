//! The shared library of an FMU for FMI 3.0.

use fmu_export::fmi3::Functions;
use std::path::Path;

/// A loaded library. It must outlive its instances.
#[derive(Debug)]
pub struct Library {
    /// Its functions.
    pub functions: Functions,
    _loaded: libloading::Library,
}

macro_rules! find_all {
    ($($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+) => {
        /// Finds every function.
        ///
        /// # Safety
        /// As of [`load`].
        unsafe fn find_all(library: &libloading::Library) -> Result<Functions, libloading::Error> {
            // SAFETY: by the caller's promise functions of these names have these types.
            unsafe {
                Ok(Functions {
                    fmi3GetVersion: *library.get(b"fmi3GetVersion")?,
                    fmi3InstantiateModelExchange: *library.get(b"fmi3InstantiateModelExchange")?,
                    fmi3InstantiateCoSimulation: *library.get(b"fmi3InstantiateCoSimulation")?,
                    fmi3InstantiateScheduledExecution: *library.get(b"fmi3InstantiateScheduledExecution")?,
                    fmi3FreeInstance: *library.get(b"fmi3FreeInstance")?,
                    $($function: *library.get(stringify!($function).as_bytes())?,)+
                })
            }
        }
    };
}

fmu_export::fmi3_functions!(find_all);

/// Loads the shared library of an FMU.
///
/// # Safety
/// The file is the library of an FMU for FMI 3.0: its functions have the types of the standard, and what it does when it
/// is loaded is sound.
///
/// # Errors
/// When it cannot be loaded, or lacks a function; the message names it.
pub unsafe fn load(path: &Path) -> Result<Library, libloading::Error> {
    // SAFETY: the caller's promise.
    let library = unsafe { libloading::Library::new(path) }?;
    // SAFETY: the caller's promise.
    let functions = unsafe { find_all(&library) }?;
    Ok(Library { functions, _loaded: library })
}
