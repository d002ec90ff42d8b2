//! Types of variables: base type, unit and range.

use crate::units::{self, Unit};
use fmi_abi::BaseType;

/// Returns the integer if the base type can represent it; otherwise compilation fails.
const fn has(base: BaseType, number: i128) -> i128 {
    match base.range() {
        Some((min, max)) if min <= number && number <= max => number,
        _ => panic!("the base type has no such value"),
    }
}

/// One item of an enumeration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item {
    /// Name of the item.
    pub name: &'static str,
    /// Number of the item at the FMI interface.
    pub value: i32,
    /// Description in one sentence.
    pub description: &'static str,
}

/// The type of a variable. If it has a name, it becomes a type definition in the model description.
///
/// ```
/// use fmu_export::{Type, units};
///
/// const STIFFNESS: Type = Type::real("Stiffness", &units::N_M_PER_RAD).min(0.0).nominal(100.0);
/// const COUNT: Type = Type::integer("Count").min_integer(1).max_integer(9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Type {
    /// Name, different from the names of all variables; empty for a type without definition.
    pub name: &'static str,
    /// Attributes, which depend on the base type.
    pub attributes: Attributes,
    /// FMI base type.
    pub base: BaseType,
}

/// Attributes of a type that depend on its base type.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Attributes {
    /// Attributes of a floating-point type.
    Real {
        /// Quantity as in ISO 80000, for example `Angle`.
        quantity: &'static str,
        /// Unit of the values at the interface.
        unit: &'static Unit,
        /// Smallest value; enforced for parameters, a hint for all other variables.
        min: Option<f64>,
        /// Largest value; enforced for parameters, a hint for all other variables.
        max: Option<f64>,
        /// Order of magnitude of the values, for the scaling of solvers.
        nominal: Option<f64>,
    },
    /// Range of an integer type, enforced for parameters.
    Integer {
        /// Smallest value; by default the smallest of the base type.
        min: i128,
        /// Largest value; by default the largest of the base type.
        max: i128,
    },
    /// Attributes of a Boolean type; there are none.
    Boolean,
    /// Attributes of a string type; there are none.
    String,
    /// Attributes of a binary type.
    Binary {
        /// Kind of data, for example `image/png`.
        mime_type: &'static str,
        /// Largest number of bytes, enforced for all values that importers set.
        max_size: usize,
    },
    /// Items of an enumeration type.
    Enumeration(&'static [Item]),
}

/// A dimensionless number.
pub const NUMBER: Type = Type::real("Number", &units::ONE);
/// A time in s.
pub const TIME: Type = Type::real("Time", &units::S);
/// An integer without further limits.
pub const INTEGER: Type = Type::integer("");
/// A Boolean.
pub const BOOLEAN: Type = Type { name: "", attributes: Attributes::Boolean, base: BaseType::Boolean };
/// A string.
pub const STRING: Type = Type { name: "", attributes: Attributes::String, base: BaseType::String };
/// A binary value of any kind.
pub const BINARY: Type = Type::binary("", "application/octet-stream");

impl Type {
    /// Creates the type of a physical quantity in this unit. `name` is the name of the type and of the quantity,
    /// unless [`quantity`](Self::quantity) sets another quantity. The type has no range and no nominal value at
    /// first.
    pub const fn real(name: &'static str, unit: &'static Unit) -> Self {
        let attributes = Attributes::Real { quantity: name, unit, min: None, max: None, nominal: None };
        Self { name, attributes, base: BaseType::Real }
    }

    /// Creates the type of a physical quantity in single precision; see [`real`](Self::real).
    pub const fn float32(name: &'static str, unit: &'static Unit) -> Self {
        Self { base: BaseType::Float32, ..Self::real(name, unit) }
    }

    /// Creates an integer type with the base type `i32`.
    pub const fn integer(name: &'static str) -> Self {
        Self::whole(name, BaseType::Integer)
    }

    /// Creates an integer type with another base type than `i32`, such as [`BaseType::UInt16`].
    #[track_caller]
    pub const fn whole(name: &'static str, base: BaseType) -> Self {
        let Some((min, max)) = base.range() else { panic!("the base type is not an integer type") };
        Self { name, attributes: Attributes::Integer { min, max }, base }
    }

    /// Creates a binary type with this MIME type. Its values may have up to 1 MiB.
    pub const fn binary(name: &'static str, mime_type: &'static str) -> Self {
        let attributes = Attributes::Binary { mime_type, max_size: 1 << 20 };
        Self { name, attributes, base: BaseType::Binary }
    }

    /// Creates an enumeration type. [`enumeration!`](crate::enumeration) generates the list of items.
    pub const fn enumeration(name: &'static str, items: &'static [Item]) -> Self {
        Self { name, attributes: Attributes::Enumeration(items), base: BaseType::Enumeration }
    }

    /// Sets the quantity of a Real type if it differs from the name of the type, for example `Velocity` for a type
    /// `Speed`.
    #[must_use]
    #[track_caller]
    pub const fn quantity(mut self, name: &'static str) -> Self {
        let Attributes::Real { quantity, .. } = &mut self.attributes else { panic!("quantity is for Reals") };
        *quantity = name;
        self
    }

    /// Sets the smallest value of a Real type.
    #[must_use]
    #[track_caller]
    pub const fn min(mut self, smallest: f64) -> Self {
        let Attributes::Real { min, .. } = &mut self.attributes else {
            panic!("min is for Reals; integers have min_integer")
        };
        *min = Some(smallest);
        self
    }

    /// Sets the largest value of a Real type.
    #[must_use]
    #[track_caller]
    pub const fn max(mut self, largest: f64) -> Self {
        let Attributes::Real { max, .. } = &mut self.attributes else {
            panic!("max is for Reals; integers have max_integer")
        };
        *max = Some(largest);
        self
    }

    /// Sets the nominal value of a Real type.
    #[must_use]
    #[track_caller]
    pub const fn nominal(mut self, magnitude: f64) -> Self {
        let Attributes::Real { nominal, .. } = &mut self.attributes else { panic!("nominal is for Reals") };
        *nominal = Some(magnitude);
        self
    }

    /// Sets the smallest value of an integer type.
    #[must_use]
    #[track_caller]
    pub const fn min_integer(mut self, smallest: i128) -> Self {
        let base = self.base;
        let Attributes::Integer { min, .. } = &mut self.attributes else {
            panic!("min_integer is for integers")
        };
        *min = has(base, smallest);
        self
    }

    /// Sets the largest value of an integer type.
    #[must_use]
    #[track_caller]
    pub const fn max_integer(mut self, largest: i128) -> Self {
        let base = self.base;
        let Attributes::Integer { max, .. } = &mut self.attributes else {
            panic!("max_integer is for integers")
        };
        *max = has(base, largest);
        self
    }

    /// Sets the largest number of bytes of a binary type, at most 1 MiB.
    #[must_use]
    #[track_caller]
    pub const fn max_size(mut self, largest: usize) -> Self {
        let Attributes::Binary { max_size, .. } = &mut self.attributes else {
            panic!("max_size is for Binary")
        };
        assert!(largest <= *max_size, "max_size must be at most 1 MiB");
        *max_size = largest;
        self
    }

    /// Returns the base type.
    pub const fn base(&self) -> BaseType {
        self.base
    }

    /// Returns the nominal value of a Real type; 1 by default.
    pub const fn nominal_or_one(&self) -> f64 {
        match self.attributes {
            Attributes::Real { nominal: Some(nominal), .. } => nominal,
            _ => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantity_may_differ_from_the_name() {
        let width = Type::real("Length", &units::ONE).quantity("Width");
        assert!(matches!(width.attributes, Attributes::Real { quantity: "Width", .. }));
        assert_eq!(width.name, "Length");
    }
}
