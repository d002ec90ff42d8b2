//! The functions of both standards, called by their names with arguments as words: the one place that knows their types.

use crate::c_types::{c_int, c_void};
use crate::{Rule, Standard};

/// The name and the type of an argument.
#[derive(Debug)]
pub struct Argument {
    /// Its name.
    pub name: &'static str,
    /// Its type, as `fmi-abi` writes it.
    pub of: &'static str,
}

impl Argument {
    /// What it points to, without the name of the standard, and whether that is only read; `None` if it is no pointer.
    pub fn pointee(&self) -> Option<(&'static str, bool)> {
        // Macros may have put a space behind the star.
        let (mutability, of) = self.of.strip_prefix('*')?.trim_start().split_once(' ')?;
        Some((
            of.strip_prefix("fmi2").or_else(|| of.strip_prefix("fmi3")).unwrap_or(of),
            mutability == "const",
        ))
    }
}

/// A function that works on an instance.
#[derive(Debug)]
pub struct Signature {
    /// Where it may be called.
    pub rule: &'static Rule,
    /// What it is given after the instance.
    pub arguments: &'static [Argument],
}

/// An argument from a word.
trait FromWord {
    fn from_word(word: u64) -> Self;
}

impl FromWord for f64 {
    fn from_word(word: u64) -> Self {
        Self::from_bits(word)
    }
}

macro_rules! whole {
    ($($of:ty)*) => { $(impl FromWord for $of {
        #[allow(trivial_numeric_casts)]
        fn from_word(word: u64) -> Self {
            word as $of
        }
    })* };
}
whole!(u8 i32 u32 usize);

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
        /// Those of the standard, in its order.
        pub const SIGNATURES: &[Signature] = &[
            $(Signature {
                rule: Function::$function.rule(),
                arguments: &[$(Argument { name: stringify!($argument), of: stringify!($type) }),*],
            }),+
        ];

        /// The names of those that need no instance.
        pub const FREE: &[&str] = &[$(stringify!($free)),+];

        /// Calls the function of this name at this address.
        ///
        /// # Safety
        /// The address is that of a function of this name as the standard declares it, and the words are what it takes.
        pub unsafe fn call(address: *const c_void, name: &str, instance: *mut c_void, words: &[u64]) -> c_int {
            let mut words = words.iter().copied();
            match name {
                $(stringify!($function) => {
                    let function: unsafe extern "C" fn($handle $(, $type)*) -> c_int =
                        // SAFETY: the caller's promise.
                        unsafe { std::mem::transmute(address) };
                    // SAFETY: the caller's promise.
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

/// FMI 2.0.
pub mod fmi2 {
    use super::{Argument, FromWord, Signature, c_int, c_void};
    use crate::fmi2::{Function, types::*};
    crate::fmi2::functions!(calls);
}

/// FMI 3.0.
pub mod fmi3 {
    use super::{Argument, FromWord, Signature, c_int, c_void};
    use crate::fmi3::{Function, types::*};
    crate::fmi3::functions!(calls);
}

/// The functions of a standard that work on an instance.
pub const fn signatures(standard: Standard) -> &'static [Signature] {
    match standard {
        Standard::Fmi2 => fmi2::SIGNATURES,
        Standard::Fmi3 => fmi3::SIGNATURES,
    }
}

/// One of them.
pub fn signature(name: &str) -> Option<&'static Signature> {
    let standard = if name.starts_with("fmi3") { Standard::Fmi3 } else { Standard::Fmi2 };
    signatures(standard).iter().find(|of| of.rule.name == name)
}

/// Calls it.
///
/// # Safety
/// As of [`fmi2::call`].
pub unsafe fn call(address: *const c_void, name: &str, instance: *mut c_void, words: &[u64]) -> c_int {
    // SAFETY: the caller's promise.
    unsafe {
        if name.starts_with("fmi3") {
            fmi3::call(address, name, instance, words)
        } else {
            fmi2::call(address, name, instance, words)
        }
    }
}
