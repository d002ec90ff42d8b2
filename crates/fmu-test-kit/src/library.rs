//! The shared library of an FMU, loaded until the program ends.

use fmi_abi::calls::{Library, LoadError};
use fmi_abi::fmi2::Functions;
use fmu_export::{Exported, Standard};
use std::path::Path;
use std::sync::OnceLock;

/// Loads the shared library of an FMU for FMI 2.0, which must have all functions of the standard. The library is never
/// unloaded.
///
/// # Safety
/// The file is the library of an FMU for FMI 2.0: its functions have the types of the standard, and loading
/// it is sound.
///
/// # Errors
/// Fails if the library cannot be loaded, or lacks a function; the message names the function.
pub unsafe fn load(path: &Path) -> Result<Functions, LoadError> {
    // SAFETY: the caller guarantees that loading is sound.
    let library = Box::leak(Box::new(unsafe { Library::load(path, Standard::Fmi2) }?));
    for name in Functions::NAMES {
        library.find(name)?;
    }
    // SAFETY: the caller guarantees the types of the functions; the library is never unloaded.
    Ok(unsafe { Functions::find(|name| library.find(name).ok()) })
}

/// Returns the functions of a model in this program, or of the library that the environment variable `FMU_LIBRARY` names.
/// The variable is used to test other builds of the model.
///
/// # Panics
/// Panics if [`load`] fails for that library.
pub fn functions_of<M: Exported>() -> Functions {
    other_library().unwrap_or_else(fmu_export::fmi2::functions::<M>)
}

/// Returns the functions of the library that `FMU_LIBRARY` names; `None` if this variable is empty or not set.
pub(crate) fn other_library() -> Option<Functions> {
    static LIBRARY: OnceLock<Option<Functions>> = OnceLock::new();
    *LIBRARY.get_or_init(|| {
        let path = std::env::var_os("FMU_LIBRARY").filter(|path| !path.is_empty())?;
        // SAFETY: the user who sets the variable guarantees that it names a suitable library.
        Some(unsafe { load(Path::new(&path)) }.expect("FMU_LIBRARY must name an FMU's library"))
    })
}
