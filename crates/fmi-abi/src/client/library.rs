//! Loads the library of an FMU in a way that works with most FMUs.

use super::float::keeping_environment;
use crate::Standard;
use crate::calls::{Library, LoadError, provide_symbols};
use std::path::Path;

/// Loads a library. Functions of interface types that the FMU does not support may be missing; calls of missing functions return
/// errors.
///
/// # Safety
/// The file is the library of an FMU of this FMI version. Its functions have the types of the FMI standard, and it is sound to
/// load the library and to call them.
///
/// # Errors
/// Fails if the library cannot be loaded, or if it has no function that frees instances, because then each instance would leak.
pub unsafe fn load(path: &Path, standard: Standard) -> Result<Library, LoadError> {
    provide_symbols();
    // SAFETY: the caller guarantees that loading is sound, and that the functions have the types of the FMI standard.
    let library = keeping_environment(|| unsafe { Library::load(path, standard) })?;
    library.find(match standard {
        Standard::Fmi2 => "fmi2FreeInstance",
        Standard::Fmi3 => "fmi3FreeInstance",
    })?;
    Ok(library)
}
