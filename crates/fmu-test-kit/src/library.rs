//! The shared library of an FMU, loaded for as long as the program runs.

use fmi_abi::c_types::c_void;
use fmi_abi::fmi2::Functions;
use fmu_export::Exported;
use std::path::Path;
use std::sync::OnceLock;

/// Loads the shared library of an FMU that has all functions; it stays.
///
/// # Safety
/// The file is the library of an FMU for FMI 2.0: its functions have the types of the standard, and what it does when it
/// is loaded is sound.
///
/// # Errors
/// When it cannot be loaded, or lacks a function; the message names it.
pub unsafe fn load(path: &Path) -> Result<Functions, libloading::Error> {
    // SAFETY: the caller's promise.
    let library = Box::leak(Box::new(unsafe { libloading::Library::new(path) }?));
    // SAFETY: the symbol is only looked up.
    let symbol = |name: &str| unsafe { library.get::<*const c_void>(name) }.map(|found| *found);
    for name in Functions::NAMES {
        symbol(name)?;
    }
    // SAFETY: the caller's promise; the library is never unloaded.
    Ok(unsafe { Functions::find(|name| symbol(name).ok()) })
}

/// The functions of a model: those in this program or, for tests of what else was made of the model, those of the library
/// that the environment variable `FMU_LIBRARY` names, which must be one that [`load`] may load.
///
/// # Panics
/// When that library cannot be loaded.
pub fn functions_of<M: Exported>() -> Functions {
    other_library().unwrap_or_else(fmu_export::fmi2::functions::<M>)
}

/// The library that `FMU_LIBRARY` names.
pub(crate) fn other_library() -> Option<Functions> {
    static LIBRARY: OnceLock<Option<Functions>> = OnceLock::new();
    *LIBRARY.get_or_init(|| {
        let path = std::env::var_os("FMU_LIBRARY").filter(|path| !path.is_empty())?;
        // SAFETY: who sets the variable knows what it names.
        Some(unsafe { load(Path::new(&path)) }.expect("FMU_LIBRARY names an FMU's library"))
    })
}
