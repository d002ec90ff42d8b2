//! The shared library of an FMU for FMI 3.0.

use fmu_export::fmi3::Functions;
use fmu_export::fmi3::types::*;
use std::path::Path;
use std::ptr::null_mut;

/// A loaded library. It must outlive its instances.
#[derive(Debug)]
pub struct Library {
    /// Its functions.
    pub functions: Functions,
    _loaded: libloading::Library,
}

unsafe extern "C" fn no_model_exchange(
    _: fmi3String,
    _: fmi3String,
    _: fmi3String,
    _: fmi3Boolean,
    _: fmi3Boolean,
    _: fmi3InstanceEnvironment,
    _: Option<fmi3LogMessageCallback>,
) -> fmi3Instance {
    null_mut()
}

unsafe extern "C" fn no_co_simulation(
    _: fmi3String,
    _: fmi3String,
    _: fmi3String,
    _: fmi3Boolean,
    _: fmi3Boolean,
    _: fmi3Boolean,
    _: fmi3Boolean,
    _: *const fmi3ValueReference,
    _: usize,
    _: fmi3InstanceEnvironment,
    _: Option<fmi3LogMessageCallback>,
    _: Option<fmi3IntermediateUpdateCallback>,
) -> fmi3Instance {
    null_mut()
}

unsafe extern "C" fn no_scheduled_execution(
    _: fmi3String,
    _: fmi3String,
    _: fmi3String,
    _: fmi3Boolean,
    _: fmi3Boolean,
    _: fmi3InstanceEnvironment,
    _: Option<fmi3LogMessageCallback>,
    _: Option<fmi3ClockUpdateCallback>,
    _: Option<fmi3LockPreemptionCallback>,
    _: Option<fmi3UnlockPreemptionCallback>,
) -> fmi3Instance {
    null_mut()
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
                    fmi3GetVersion: *library.get(b"fmi3GetVersion")?,
                    fmi3InstantiateModelExchange: library
                        .get(b"fmi3InstantiateModelExchange")
                        .map_or(no_model_exchange, |found| *found),
                    fmi3InstantiateCoSimulation: library
                        .get(b"fmi3InstantiateCoSimulation")
                        .map_or(no_co_simulation, |found| *found),
                    fmi3InstantiateScheduledExecution: library
                        .get(b"fmi3InstantiateScheduledExecution")
                        .map_or(no_scheduled_execution, |found| *found),
                    fmi3FreeInstance: *library.get(b"fmi3FreeInstance")?,
                    $($function: match library.get(stringify!($function).as_bytes()) {
                        Ok(found) => *found,
                        Err(_) => {
                            unsafe extern "C" fn absent(_: fmi3Instance $(, _: $type)*) -> Status {
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

fmu_export::fmi3_functions!(find_all);

/// Loads the shared library of an FMU.
///
/// # Safety
/// The file is the library of an FMU for FMI 3.0: its functions have the types of the standard, and what it does when it
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
