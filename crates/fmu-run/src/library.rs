//! The shared library of an FMU.

use fmu_export::Exported;
use fmu_export::fmi2::Functions;
use fmu_export::fmi2::types::*;
use std::ffi::OsString;
use std::path::Path;
use std::sync::OnceLock;

/// A loaded library. It must outlive its instances.
#[derive(Debug)]
pub struct Library {
    /// Its functions.
    pub functions: Functions,
    _loaded: libloading::Library,
}

macro_rules! find_all {
    ($($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+) => {
        /// Finds the functions. An FMU need not have those of an interface type that it does not offer: calls of these
        /// are errors.
        ///
        /// # Safety
        /// As of [`load`].
        unsafe fn find_all(library: &libloading::Library) -> Result<Functions, libloading::Error> {
            // SAFETY: by the caller's promise functions of these names have these types.
            unsafe {
                Ok(Functions {
                    fmi2GetTypesPlatform: *library.get(b"fmi2GetTypesPlatform")?,
                    fmi2GetVersion: *library.get(b"fmi2GetVersion")?,
                    fmi2Instantiate: *library.get(b"fmi2Instantiate")?,
                    fmi2FreeInstance: *library.get(b"fmi2FreeInstance")?,
                    $($function: match library.get(stringify!($function).as_bytes()) {
                        Ok(found) => *found,
                        Err(_) => {
                            unsafe extern "C" fn absent(_: fmi2Component $(, _: $type)*) -> Status {
                                Status::Error
                            }
                            absent
                        }
                    },)+
                })
            }
        }
    };
}

fmu_export::fmi2_functions!(find_all);

/// The functions of a model: those in this program or, for tests of what else was made of the model, those of the library
/// that the environment variable `FMU_LIBRARY` names, which must be one that [`load`] may load.
///
/// # Panics
/// When that library cannot be loaded.
pub fn functions_of<M: Exported>() -> Functions {
    other_library().map_or_else(Functions::of::<M>, |library| library.functions)
}

/// The library that `FMU_LIBRARY` names.
fn other_library() -> Option<&'static Library> {
    static LIBRARY: OnceLock<Option<Library>> = OnceLock::new();
    let named = || std::env::var_os("FMU_LIBRARY").filter(|path| !path.is_empty());
    // SAFETY: who sets the variable knows what it names.
    let load =
        |path: OsString| unsafe { load(Path::new(&path)) }.expect("FMU_LIBRARY names an FMU's library");
    LIBRARY.get_or_init(|| named().map(load)).as_ref()
}

/// Loads the shared library of an FMU.
///
/// # Safety
/// The file is the library of an FMU for FMI 2.0: its functions have the types of the standard, and what it does when it
/// is loaded is sound.
///
/// # Errors
/// When it cannot be loaded, or lacks a function that needs no instance; the message names it.
pub unsafe fn load(path: &Path) -> Result<Library, libloading::Error> {
    // SAFETY: the caller's promise.
    let library = unsafe { libloading::Library::new(path) }?;
    // SAFETY: the caller's promise.
    let functions = unsafe { find_all(&library) }?;
    Ok(Library { functions, _loaded: library })
}
