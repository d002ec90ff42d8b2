//! Values of variables.

use crate::BaseType;
use std::fmt;

/// A value of a variable.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// Value of a Real or a Float32.
    Real(f64),
    /// Value of any integer type or an Enumeration.
    Integer(i128),
    /// Value of a Boolean.
    Boolean(bool),
    /// Value of a String.
    String(String),
    /// Value of a Binary.
    Binary(Vec<u8>),
}

impl Value {
    /// Returns the number of a Real; NaN for other values.
    pub fn real(&self) -> f64 {
        if let Self::Real(value) = self { *value } else { f64::NAN }
    }

    /// Parses a value in the format of [`Display`](fmt::Display); `None` if the string is not a value of this
    /// base type.
    pub fn read(base: BaseType, string: &str) -> Option<Self> {
        match base {
            BaseType::Real => string.parse().ok().map(Self::Real),
            BaseType::Float32 => string.parse().ok().map(|value: f32| Self::Real(value.into())),
            BaseType::Enumeration => string.parse().ok().map(|value: i64| Self::Integer(value.into())),
            BaseType::Boolean => boolean(string).map(Self::Boolean),
            BaseType::Binary => bytes(string).map(Self::Binary),
            BaseType::String => Some(Self::String(string.to_owned())),
            _ => {
                let (min, max) = base.range()?;
                string.parse().ok().filter(|value| (min..=max).contains(value)).map(Self::Integer)
            }
        }
    }
}

/// The blanks of XML.
pub(crate) const BLANKS: [char; 4] = [' ', '\t', '\r', '\n'];

/// Parses a Boolean of XML: `true`, `false`, `1` or `0`.
pub fn boolean(string: &str) -> Option<bool> {
    match string.trim_matches(BLANKS) {
        "true" | "1" => Some(true),
        "false" | "0" => Some(false),
        _ => None,
    }
}

/// Parses bytes with two hexadecimal digits each; `None` if the string has any other form.
fn bytes(string: &str) -> Option<Vec<u8>> {
    let digit = |byte: &u8| char::from(*byte).to_digit(16);
    let digits: Vec<u32> = string.as_bytes().iter().map(digit).collect::<Option<_>>()?;
    let (pairs, rest) = digits.as_chunks();
    let byte = |[high, low]: &[u32; 2]| u8::try_from(16 * high + low).ok();
    if rest.is_empty() { pairs.iter().map(byte).collect() } else { None }
}

impl From<f64> for Value {
    fn from(value: f64) -> Self {
        Self::Real(value)
    }
}

impl From<i32> for Value {
    fn from(value: i32) -> Self {
        Self::Integer(value.into())
    }
}

impl From<bool> for Value {
    fn from(value: bool) -> Self {
        Self::Boolean(value)
    }
}

impl From<&str> for Value {
    fn from(value: &str) -> Self {
        Self::String(value.to_owned())
    }
}

/// Writes the value as in model descriptions.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            // Uses exponents for numbers that would need many zeros.
            Self::Real(value) if *value != 0.0 && value.abs() < 1e-15 || value.abs() > 1e17 => {
                write!(f, "{value:e}")
            }
            Self::Real(value) => write!(f, "{value}"),
            Self::Integer(value) => write!(f, "{value}"),
            Self::Boolean(value) => write!(f, "{value}"),
            Self::String(value) => write!(f, "{value}"),
            Self::Binary(value) => value.iter().try_for_each(|byte| write!(f, "{byte:02X}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_as_they_are_written() {
        for (base, value) in [
            (BaseType::Real, Value::Real(0.1)),
            (BaseType::Real, Value::Real(-1e300)),
            (BaseType::Real, Value::Real(5e-324)),
            (BaseType::Float32, Value::Real(f64::from(0.1_f32))),
            (BaseType::Int8, Value::Integer(-128)),
            (BaseType::UInt64, Value::Integer(u64::MAX.into())),
            (BaseType::Enumeration, Value::Integer(5_000_000_000)),
            (BaseType::Boolean, Value::Boolean(true)),
            (BaseType::String, Value::String("a \"b\"\n".to_owned())),
            (BaseType::Binary, Value::Binary(vec![0, 0x7f, 0xff])),
        ] {
            assert_eq!(Value::read(base, &value.to_string()), Some(value));
        }
        assert_eq!(["1", "0"].map(boolean), [Some(true), Some(false)]);
        assert!(matches!(Value::read(BaseType::Real, "NaN"), Some(Value::Real(value)) if value.is_nan()));
        for (base, string) in [
            (BaseType::Real, "fast"),
            (BaseType::UInt8, "256"),
            (BaseType::Boolean, "yes"),
            (BaseType::Binary, "0"),
            (BaseType::Binary, "0g"),
        ] {
            assert_eq!(Value::read(base, string), None, "{string}");
        }
    }
}
