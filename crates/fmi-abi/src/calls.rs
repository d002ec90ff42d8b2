//! Calls the functions on an instance by name, for both FMI versions, with arguments as 64-bit words, and lists the
//! types of their arguments for use at run time.

use crate::c_types::{c_int, c_void};
use crate::{Rule, Standard};

/// Name and type of an argument.
#[derive(Debug)]
pub struct Argument {
    /// Name of the argument.
    pub name: &'static str,
    /// Type of the argument, as written in `fmi-abi`.
    pub of: &'static str,
}

impl Argument {
    /// For a type that is written as a pointer, returns the type of its target without the prefix `fmi2` or `fmi3`, and
    /// whether the function only reads the target. Returns `None` for other types, including handles such as
    /// `fmi2FMUstate`.
    pub fn pointee(&self) -> Option<(&'static str, bool)> {
        // Macro expansion may add a space after the asterisk.
        let (mutability, of) = self.of.strip_prefix('*')?.trim_start().split_once(' ')?;
        Some((
            of.strip_prefix("fmi2").or_else(|| of.strip_prefix("fmi3")).unwrap_or(of),
            mutability == "const",
        ))
    }
}

/// Signature of a function that takes an instance and returns a status.
#[derive(Debug)]
pub struct Signature {
    /// States in which the function may be called.
    pub rule: &'static Rule,
    /// Arguments after the instance.
    pub arguments: &'static [Argument],
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

macro_rules! calls {
    (
        $standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
        /// Signatures of the functions that take an instance and return a status, in the order of [`Function`].
        pub const SIGNATURES: &[Signature] = &[
            $(Signature {
                rule: Function::$function.rule(),
                arguments: &[$(Argument { name: stringify!($argument), of: stringify!($type) }),*],
            }),+
        ];

        /// Names of all other functions: versions, creation and release of instances.
        pub const FREE: &[&str] = &[$(stringify!($free)),+];

        /// Calls the function `name` at `address` and returns its status. `words` are the arguments after the instance;
        /// missing words are 0. Returns -1 if [`SIGNATURES`] does not contain the function.
        ///
        /// # Safety
        /// The function at `address` has the type that the FMI standard defines for `name`, and the words are valid
        /// arguments for it.
        pub unsafe fn call(address: *const c_void, name: &str, instance: *mut c_void, words: &[u64]) -> c_int {
            let mut words = words.iter().copied();
            match name {
                $(stringify!($function) => {
                    let function: unsafe extern "C" fn($handle $(, $type)*) -> c_int =
                        // SAFETY: the caller guarantees the type of the function.
                        unsafe { std::mem::transmute(address) };
                    // SAFETY: the caller guarantees that the arguments are valid.
                    unsafe { function(instance $(, <$type as FromWord>::from_word({
                        let _ = stringify!($argument);
                        words.next().unwrap_or_default()
                    }))*) }
                })+
                _ => -1,
            }
        }
    };
}

/// Calls of FMI 2.0.
pub mod fmi2 {
    use super::{Argument, FromWord, Signature, c_int, c_void};
    use crate::fmi2::{Function, types::*};
    crate::fmi2::functions!(calls);
}

/// Calls of FMI 3.0.
pub mod fmi3 {
    use super::{Argument, FromWord, Signature, c_int, c_void};
    use crate::fmi3::{Function, types::*};
    crate::fmi3::functions!(calls);
}

/// Returns the signatures of an FMI version.
pub const fn signatures(standard: Standard) -> &'static [Signature] {
    match standard {
        Standard::Fmi2 => fmi2::SIGNATURES,
        Standard::Fmi3 => fmi3::SIGNATURES,
    }
}

/// Returns the signature of the function with this name; `None` if no function that takes an instance and returns a
/// status has this name.
pub fn signature(name: &str) -> Option<&'static Signature> {
    let standard = if name.starts_with("fmi3") { Standard::Fmi3 } else { Standard::Fmi2 };
    signatures(standard).iter().find(|of| of.rule.name == name)
}

/// Calls a function of either FMI version; see [`fmi2::call`].
///
/// # Safety
/// Same as for [`fmi2::call`].
pub unsafe fn call(address: *const c_void, name: &str, instance: *mut c_void, words: &[u64]) -> c_int {
    // SAFETY: the caller guarantees the requirements, which are the same.
    unsafe {
        if name.starts_with("fmi3") {
            fmi3::call(address, name, instance, words)
        } else {
            fmi2::call(address, name, instance, words)
        }
    }
}
