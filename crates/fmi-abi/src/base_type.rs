//! Base types of values.

use crate::Standard;
use std::fmt;

/// Defines the base types. Each line contains a description and the XML elements: for FMI 2.0 in brackets, which are
/// empty if FMI 2.0 lacks the type, then for FMI 3.0.
macro_rules! base_types {
    ($($base:ident $description:literal [$($fmi2:literal)?] $fmi3:literal;)+) => {
        /// Base types of variables. FMI 2.0 has only Real, Integer, Boolean, String and Enumeration. FMI 3.0 has all
        /// of them; it calls Real Float64 and Integer Int32.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum BaseType { $(#[doc = $description] $base,)+ }

        impl BaseType {
            /// All base types.
            pub const ALL: [Self; 14] = [$(Self::$base),+];

            /// Returns the name of the XML element in model descriptions, if the FMI version has this type.
            pub const fn element(self, standard: Standard) -> Option<&'static str> {
                match (standard, self) {
                    $($((Standard::Fmi2, Self::$base) => Some($fmi2),)?)+
                    (Standard::Fmi2, _) => None,
                    $((Standard::Fmi3, Self::$base) => Some($fmi3),)+
                }
            }
        }
    };
}

base_types! {
    Real "A floating-point number, `f64` in Rust." ["Real"] "Float64";
    Float32 "A floating-point number, `f32` in Rust." [] "Float32";
    Integer "An integer, `i32` in Rust." ["Integer"] "Int32";
    Int8 "An integer, `i8` in Rust." [] "Int8";
    UInt8 "An integer, `u8` in Rust." [] "UInt8";
    Int16 "An integer, `i16` in Rust." [] "Int16";
    UInt16 "An integer, `u16` in Rust." [] "UInt16";
    UInt32 "An integer, `u32` in Rust." [] "UInt32";
    Int64 "An integer, `i64` in Rust." [] "Int64";
    UInt64 "An integer, `u64` in Rust." [] "UInt64";
    Boolean "A Boolean, `bool` in Rust." ["Boolean"] "Boolean";
    String "A string, `String` in Rust." ["String"] "String";
    Binary "Bytes, `Vec<u8>` in Rust." [] "Binary";
    Enumeration "An item of an enumeration, an enum in Rust." ["Enumeration"] "Enumeration";
}

impl BaseType {
    /// Returns whether FMI 2.0 has this type.
    pub const fn is_in_fmi2(self) -> bool {
        self.element(Standard::Fmi2).is_some()
    }

    /// Returns whether values are floating-point numbers.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::Real | Self::Float32)
    }

    /// Returns the smallest and the largest value of an integer type; `None` for other types.
    pub const fn range(self) -> Option<(i128, i128)> {
        Some(match self {
            Self::Int8 => (i8::MIN as i128, i8::MAX as i128),
            Self::UInt8 => (0, u8::MAX as i128),
            Self::Int16 => (i16::MIN as i128, i16::MAX as i128),
            Self::UInt16 => (0, u16::MAX as i128),
            Self::Integer => (i32::MIN as i128, i32::MAX as i128),
            Self::UInt32 => (0, u32::MAX as i128),
            Self::Int64 => (i64::MIN as i128, i64::MAX as i128),
            Self::UInt64 => (0, u64::MAX as i128),
            _ => return None,
        })
    }
}

impl fmt::Display for BaseType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}
