//! The functions of an FMU: finds them by their names, and calls them with arguments as 64-bit words.

use super::instantiation::Instantiation;
use super::signatures::{Argument, Signature};
use crate::c_types::{c_char, c_int, c_void};
use crate::{Standard, Status, fmi2, fmi3};
use std::ptr::{null, null_mut};

/// Functions of an FMU, for one FMI version.
#[derive(Clone, Debug)]
pub enum Functions {
    /// Functions of FMI 2.0.
    Fmi2(Box<fmi2::Functions>),
    /// Functions of FMI 3.0.
    Fmi3(Box<fmi3::Functions>),
}

/// Evaluates an expression for the functions of either FMI version.
macro_rules! either {
    ($self:ident, $functions:ident => $body:expr) => {
        match $self {
            Self::Fmi2($functions) => $body,
            Self::Fmi3($functions) => $body,
        }
    };
}

impl Functions {
    /// Returns the FMI version.
    pub fn standard(&self) -> Standard {
        match self {
            Self::Fmi2(_) => Standard::Fmi2,
            Self::Fmi3(_) => Standard::Fmi3,
        }
    }

    /// Calls the instantiation function and returns the instance.
    ///
    /// # Safety
    /// Same as for [`fmi2::Functions::instantiate`].
    pub unsafe fn instantiate(&self, arguments: &Instantiation) -> *mut c_void {
        // SAFETY: the caller guarantees the requirements, which are the same.
        either!(self, functions => unsafe { functions.instantiate(arguments) })
    }

    /// Frees an instance.
    ///
    /// # Safety
    /// The function accepts the pointer: NULL, or an instance that has not been freed.
    pub unsafe fn free(&self, instance: *mut c_void) {
        // SAFETY: the caller guarantees that the function accepts the pointer.
        unsafe {
            match self {
                Self::Fmi2(functions) => (functions.fmi2FreeInstance)(instance),
                Self::Fmi3(functions) => (functions.fmi3FreeInstance)(instance),
            }
        }
    }

    /// Calls a function that takes an instance, by its name; see [`fmi2::Functions::call`].
    ///
    /// # Safety
    /// Same as for [`fmi2::Functions::call`].
    pub unsafe fn call(&self, name: &str, instance: *mut c_void, words: &[u64]) -> Option<c_int> {
        // SAFETY: the caller guarantees the requirements, which are the same.
        either!(self, functions => unsafe { functions.call(name, instance, words) })
    }

    /// Calls a function that takes no argument and returns a string, by its name; returns NULL if there is no such function.
    ///
    /// # Safety
    /// It is sound to call the function.
    pub unsafe fn version(&self, name: &str) -> *const c_char {
        // SAFETY: the caller guarantees that the calls are sound.
        unsafe {
            match (self, name) {
                (Self::Fmi2(functions), "fmi2GetVersion") => (functions.fmi2GetVersion)(),
                (Self::Fmi2(functions), "fmi2GetTypesPlatform") => (functions.fmi2GetTypesPlatform)(),
                (Self::Fmi3(functions), "fmi3GetVersion") => (functions.fmi3GetVersion)(),
                _ => null(),
            }
        }
    }
}

/// Result of the function that replaces a missing one, for each result type other than a status.
trait Absent {
    const RESULT: Self;
}

impl Absent for () {
    const RESULT: Self = ();
}

impl Absent for *mut c_void {
    const RESULT: Self = null_mut();
}

impl Absent for *const c_char {
    const RESULT: Self = null();
}

/// Conversion of a 64-bit word to an argument.
trait FromWord {
    fn from_word(word: u64) -> Self;
}

impl FromWord for f64 {
    fn from_word(word: u64) -> Self {
        Self::from_bits(word)
    }
}

macro_rules! integers {
    ($($of:ty)*) => { $(impl FromWord for $of {
        #[allow(trivial_numeric_casts)]
        fn from_word(word: u64) -> Self {
            word as $of
        }
    })* };
}
integers!(u8 i32 u32 usize);

impl<T> FromWord for *const T {
    fn from_word(word: u64) -> Self {
        word as usize as Self
    }
}

impl<T> FromWord for *mut T {
    fn from_word(word: u64) -> Self {
        word as usize as Self
    }
}

/// Defines the signatures of an FMI version, `find` and `call`.
macro_rules! functions {
    (
        $standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
        impl Functions {
            pub(in crate::calls) const SIGNATURES: &[Signature] = &[
                $(Signature {
                    rule: Function::$function.rule(),
                    arguments: &[$(Argument { name: stringify!($argument), of: stringify!($type) }),*],
                }),+
            ];

            pub(in crate::calls) const WITHOUT_INSTANCE: &[&str] = &[$(stringify!($free)),+];

            /// Finds the functions of a library by their names. `symbol` returns the address of the function with the
            /// given name, or `None` if the library lacks it. A missing function is replaced by one that returns Error,
            /// a null pointer or nothing, as its type requires.
            ///
            /// # Safety
            /// Each address that `symbol` returns is the address of the function of that name, whose type is as in the
            /// FMI standard. The library stays loaded while the functions are used.
            pub unsafe fn find(mut symbol: impl FnMut(&'static str) -> Option<*const c_void>) -> Self {
                Self {
                    $($free: match symbol(stringify!($free)) {
                        // SAFETY: the caller guarantees the type.
                        Some(found) => unsafe {
                            std::mem::transmute::<*const _, unsafe extern "C" fn($($free_type),*) -> $result>(found)
                        },
                        None => {
                            unsafe extern "C" fn absent($(_: $free_type),*) -> $result {
                                Absent::RESULT
                            }
                            absent
                        }
                    },)+
                    $($function: match symbol(stringify!($function)) {
                        // SAFETY: the caller guarantees the type.
                        Some(found) => unsafe {
                            std::mem::transmute::<*const _, unsafe extern "C" fn($handle $(, $type)*) -> c_int>(found)
                        },
                        None => {
                            unsafe extern "C" fn absent(_: $handle $(, _: $type)*) -> c_int {
                                Status::Error as _
                            }
                            absent
                        }
                    },)+
                }
            }

            /// Calls the function of this name, which takes an instance, and returns its status. `words` are the arguments after the
            /// instance; missing words are 0. Returns `None` if the FMI version has no such function.
            ///
            /// # Safety
            /// The function accepts the instance and the words as arguments.
            pub unsafe fn call(&self, name: &str, instance: *mut c_void, words: &[u64]) -> Option<c_int> {
                let mut words = words.iter().copied();
                match name {
                    // SAFETY: the caller guarantees that the function accepts the arguments.
                    $(stringify!($function) => Some(unsafe {
                        (self.$function)(instance $(, <$type as FromWord>::from_word(words.next().unwrap_or_default()))*)
                    }),)+
                    _ => None,
                }
            }
        }
    };
}

mod of_fmi2 {
    use super::{Absent, Argument, FromWord, Signature, Status, c_int, c_void};
    use crate::fmi2::{Function, Functions, types::*};
    crate::fmi2::functions!(functions);
}

mod of_fmi3 {
    use super::{Absent, Argument, FromWord, Signature, Status, c_int, c_void};
    use crate::fmi3::{Function, Functions, types::*};
    crate::fmi3::functions!(functions);
}
