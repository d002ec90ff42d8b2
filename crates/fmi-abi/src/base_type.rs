//! Base types of values.

use crate::Standard;
use std::fmt;

/// Base types of variables. FMI 2.0 has only Real, Integer, Boolean, String and Enumeration. FMI 3.0 has all
/// of them; it calls Real Float64 and Integer Int32.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BaseType {
    /// A floating-point number, `f64` in Rust.
    Real,
    /// A floating-point number, `f32` in Rust.
    Float32,
    /// An integer, `i32` in Rust.
    Integer,
    /// An integer, `i8` in Rust.
    Int8,
    /// An integer, `u8` in Rust.
    UInt8,
    /// An integer, `i16` in Rust.
    Int16,
    /// An integer, `u16` in Rust.
    UInt16,
    /// An integer, `u32` in Rust.
    UInt32,
    /// An integer, `i64` in Rust.
    Int64,
    /// An integer, `u64` in Rust.
    UInt64,
    /// A Boolean, `bool` in Rust.
    Boolean,
    /// A string, `String` in Rust.
    String,
    /// Bytes, `Vec<u8>` in Rust.
    Binary,
    /// An item of an enumeration, an enum in Rust.
    Enumeration,
}

impl BaseType {
    /// All base types.
    pub const ALL: [Self; 14] = [
        Self::Real,
        Self::Float32,
        Self::Integer,
        Self::Int8,
        Self::UInt8,
        Self::Int16,
        Self::UInt16,
        Self::UInt32,
        Self::Int64,
        Self::UInt64,
        Self::Boolean,
        Self::String,
        Self::Binary,
        Self::Enumeration,
    ];

    /// Returns whether FMI 2.0 has this type.
    pub const fn is_in_fmi2(self) -> bool {
        matches!(self, Self::Real | Self::Integer | Self::Boolean | Self::String | Self::Enumeration)
    }

    /// Returns the name of the XML element in model descriptions, if the FMI version has this type.
    pub const fn element(self, standard: Standard) -> Option<&'static str> {
        Some(match (standard, self) {
            (_, Self::Boolean) => "Boolean",
            (_, Self::String) => "String",
            (_, Self::Enumeration) => "Enumeration",
            (Standard::Fmi2, Self::Real) => "Real",
            (Standard::Fmi2, Self::Integer) => "Integer",
            (Standard::Fmi2, _) => return None,
            (Standard::Fmi3, Self::Real) => "Float64",
            (Standard::Fmi3, Self::Float32) => "Float32",
            (Standard::Fmi3, Self::Int8) => "Int8",
            (Standard::Fmi3, Self::UInt8) => "UInt8",
            (Standard::Fmi3, Self::Int16) => "Int16",
            (Standard::Fmi3, Self::UInt16) => "UInt16",
            (Standard::Fmi3, Self::Integer) => "Int32",
            (Standard::Fmi3, Self::UInt32) => "UInt32",
            (Standard::Fmi3, Self::Int64) => "Int64",
            (Standard::Fmi3, Self::UInt64) => "UInt64",
            (Standard::Fmi3, Self::Binary) => "Binary",
        })
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
