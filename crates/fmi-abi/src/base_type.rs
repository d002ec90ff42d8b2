//! The kinds of values.

use std::fmt;

/// The kinds of values that variables have. FMI 2.0 has Real, Integer, Boolean, String and Enumeration only; FMI 3.0
/// calls a Real Float64 and an Integer Int32, and has the others as well.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BaseType {
    /// A floating-point number, `f64` in Rust.
    Real,
    /// A floating-point number, `f32` in Rust.
    Float32,
    /// A whole number, `i32` in Rust.
    Integer,
    /// A whole number, `i8` in Rust.
    Int8,
    /// A whole number, `u8` in Rust.
    UInt8,
    /// A whole number, `i16` in Rust.
    Int16,
    /// A whole number, `u16` in Rust.
    UInt16,
    /// A whole number, `u32` in Rust.
    UInt32,
    /// A whole number, `i64` in Rust.
    Int64,
    /// A whole number, `u64` in Rust.
    UInt64,
    /// A truth value, `bool` in Rust.
    Boolean,
    /// A text, `String` in Rust.
    String,
    /// Bytes, `Vec<u8>` in Rust.
    Binary,
    /// One of a list of names, an enum in Rust.
    Enumeration,
}

impl BaseType {
    /// All of them.
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

    /// Whether FMI 2.0 has it.
    pub const fn is_in_fmi2(self) -> bool {
        matches!(self, Self::Real | Self::Integer | Self::Boolean | Self::String | Self::Enumeration)
    }

    /// Whether it is a floating-point number.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::Real | Self::Float32)
    }

    /// The smallest and the largest value of a whole number; `None` for the rest.
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
