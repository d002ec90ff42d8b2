//! The shared library of an FMU, loaded for as long as anything needs it.

use fmi_abi::Standard;
use fmi_abi::c_types::{c_char, c_int, c_void};
use std::ffi::CString;
use std::path::Path;
use std::ptr::{null, null_mut};
use std::sync::Arc;
use tempfile::TempDir;

/// A loaded library, with the files of its FMU.
#[derive(Debug)]
pub(crate) struct Library {
    pub functions: Functions,
    /// Where its resources are, as importers write it.
    pub resources: CString,
    _loaded: libloading::Library,
    // Removed after the library is unloaded.
    _folder: Arc<TempDir>,
}

/// Its functions, of the one standard or the other.
#[derive(Debug)]
pub(crate) enum Functions {
    Fmi2(Box<fmi_abi::fmi2::Functions>),
    Fmi3(Box<fmi_abi::fmi3::Functions>),
}

impl Library {
    /// Loads a library. An FMU need not have the functions of an interface type that it does not offer: calls of these
    /// are errors.
    ///
    /// # Safety
    /// The file is the library of an FMU for this standard: its functions have the types of the standard, and what it does
    /// when it is loaded and called is sound.
    ///
    /// # Errors
    /// When it cannot be loaded, or lacks the function that frees instances.
    pub unsafe fn load(
        path: &Path,
        standard: Standard,
        resources: CString,
        folder: Arc<TempDir>,
    ) -> Result<Self, libloading::Error> {
        // SAFETY: the caller's promise, here and below.
        let loaded = unsafe { libloading::Library::new(path) }?;
        // SAFETY: see above.
        let functions = unsafe {
            match standard {
                Standard::Fmi2 => {
                    loaded.get::<*const c_void>("fmi2FreeInstance")?;
                    Functions::Fmi2(fmi2::find(&loaded).into())
                }
                Standard::Fmi3 => {
                    loaded.get::<*const c_void>("fmi3FreeInstance")?;
                    Functions::Fmi3(fmi3::find(&loaded).into())
                }
            }
        };
        Ok(Self { functions, resources, _loaded: loaded, _folder: folder })
    }
}

/// What a function answers that is not there.
trait Absent {
    const ANSWER: Self;
}

impl Absent for () {
    const ANSWER: Self = ();
}

impl Absent for *mut c_void {
    const ANSWER: Self = null_mut();
}

impl Absent for *const c_char {
    const ANSWER: Self = null();
}

macro_rules! find {
    (
        $standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
        /// The functions of a library.
        ///
        /// # Safety
        /// As of [`Library::load`](super::Library::load).
        pub unsafe fn find(library: &libloading::Library) -> Functions {
            // SAFETY: by the caller's promise functions of these names have these types.
            unsafe {
                Functions {
                    $($free: library.get(stringify!($free)).map_or(
                        {
                            unsafe extern "C" fn absent($(_: $free_type),*) -> $result {
                                super::Absent::ANSWER
                            }
                            absent
                        },
                        |found| *found,
                    ),)+
                    $($function: library.get(stringify!($function)).map_or(
                        {
                            unsafe extern "C" fn absent(_: $handle $(, _: $type)*) -> super::c_int {
                                fmi_abi::Status::Error as _
                            }
                            absent
                        },
                        |found| *found,
                    ),)+
                }
            }
        }
    };
}

mod fmi2 {
    use fmi_abi::fmi2::{Functions, types::*};
    fmi_abi::fmi2_functions!(find);
}

mod fmi3 {
    use fmi_abi::fmi3::{Functions, types::*};
    fmi_abi::fmi3_functions!(find);
}
