#![doc = include_str!("../README.md")]
// Under Miri, the log callback is variadic as in C.
#![cfg_attr(all(miri, feature = "calls"), feature(c_variadic))]

#[cfg(feature = "description")]
mod attribute;
mod base_type;
pub mod c_types;
#[cfg(feature = "calls")]
#[allow(unsafe_code, reason = "it calls FMUs and receives their messages")]
pub mod calls;
mod causality;
#[cfg(feature = "client")]
#[allow(unsafe_code, reason = "it calls FMUs")]
pub mod client;
#[cfg(feature = "description")]
pub mod description;
#[cfg(feature = "files")]
pub mod files;
pub mod fmi2;
pub mod fmi3;
mod limits;
mod log_category;
mod mode;
mod rule;
pub mod stamp;
mod standard;
mod status;
mod text;
mod unit;
mod unit_name;
mod value;
#[cfg(feature = "write")]
pub mod write;
#[cfg(feature = "description")]
pub mod xml;

pub use base_type::BaseType;
pub use causality::{Causality, DependencyKind, Initial, IntervalVariability, Variability};
pub use limits::{empty_range, ends_too_early};
pub use log_category::Category;
pub use mode::{AllowedStates, FmiState, Mode};
pub use rule::Rule;
pub use standard::{Interface, Standard};
pub use status::Status;
pub use text::{
    SHOWN, is_c_identifier, is_plain_file_name, is_structured_name, one_line, shown, shown_number, shown_to,
};
pub use unit::{BASE_UNITS, BaseUnit, DisplayUnit, Unit};
pub use value::{Value, boolean};

/// Defines the items of an FMI version's module from its list of functions.
macro_rules! table {
    (
        $standard:ident $handle:ident
        without an instance { $($free:ident($($free_argument:ident: $free_type:ty),*) -> $result:ty;)+ }
        with an instance {
            $($function:ident $cs:literal $me:literal $tolerated:literal ($($argument:ident: $type:ty),*);)+
        }
    ) => {
        /// The functions that take an instance and return a status.
        #[allow(non_camel_case_types, missing_docs)]
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Function { $($function),+ }

        impl Function {
            /// Returns the function's row of [`ALLOWED`].
            #[inline]
            pub const fn rule(self) -> &'static $crate::Rule {
                &ALLOWED[self as usize]
            }
        }

        /// The table of allowed calls, in the order of [`Function`].
        pub const ALLOWED: &[$crate::Rule] = &[
            $($crate::Rule::new($crate::Standard::$standard, stringify!($function), $cs, $me, $tolerated)),+
        ];

        /// Pointers to all functions of the FMI version, as an importer loads them from a library.
        #[allow(missing_docs, non_snake_case, reason = "each has the name of its function")]
        #[derive(Clone, Copy, Debug)]
        pub struct Functions {
            $(pub $free: unsafe extern "C" fn($($free_type),*) -> $result,)+
            $(pub $function: unsafe extern "C" fn($handle $(, $type)*) -> $crate::c_types::c_int,)+
        }

        impl Functions {
            /// The names of all functions.
            pub const NAMES: &[&str] = &[$(stringify!($free),)+ $(stringify!($function),)+];
        }
    };
}
pub(crate) use table;
