//! Declared types, and the attributes that a variable shares with its type.

use crate::{BaseType, Value};
use std::sync::Arc;

/// A declared type (section 2.2.3 of FMI 2.0, 2.4.4 of FMI 3.0).
#[derive(Clone, Debug, PartialEq)]
pub struct Type {
    /// Base type; `None` for a clock or an unknown type.
    pub base: Option<BaseType>,
    /// Attributes that a variable of this type has unless it has its own.
    pub attributes: Attributes,
    /// Items of an enumeration, in the order of the file.
    pub items: Vec<Item>,
    /// Description; empty if missing.
    pub description: String,
}

/// An item of an enumeration.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// Name.
    pub name: String,
    /// Number.
    pub value: i64,
    /// Description; empty if missing.
    pub description: String,
}

impl Item {
    /// Returns whether two enumerations have the same names and numbers, in the same order.
    pub fn are_same(one: &[Self], other: &[Self]) -> bool {
        let is_same = |(one, other): (&Self, &Self)| one.name == other.name && one.value == other.value;
        one.len() == other.len() && one.iter().zip(other).all(is_same)
    }
}

/// Attributes that a variable has itself or gets from its declared type (section 2.2.7 of FMI 2.0, 2.4.7.3 of FMI 3.0).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attributes {
    /// Physical quantity, if given.
    pub quantity: Option<Arc<str>>,
    /// Unit, if given.
    pub unit: Option<Arc<str>>,
    /// Display unit, if given.
    pub display_unit: Option<Arc<str>>,
    /// Whether the values are differences of physical quantities (`relativeQuantity`), whose conversion to a display unit has no offset
    /// (section 2.2.3 of FMI 2.0, 2.4.4 of FMI 3.0). False if it is missing.
    pub is_relative: bool,
    /// Smallest value, if given. Integers keep all digits.
    pub min: Option<Value>,
    /// Largest value, if given. Integers keep all digits.
    pub max: Option<Value>,
    /// Nominal value, if given.
    pub nominal: Option<f64>,
    /// MIME type of a Binary, if given.
    pub mime_type: Option<Arc<str>>,
    /// Maximum number of bytes of a Binary, if given.
    pub max_size: Option<u64>,
}
