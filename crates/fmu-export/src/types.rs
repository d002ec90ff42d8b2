//! Types of variables: what kind of value, in which unit, in which range.

use crate::units::{self, Unit};
use std::fmt;

/// The kinds of values that variables have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BaseType {
    /// A floating-point number, `f64` in Rust.
    Real,
    /// A whole number, `i32` in Rust.
    Integer,
    /// A truth value, `bool` in Rust.
    Boolean,
    /// A text, `String` in Rust.
    String,
    /// One of a list of names, an enum in Rust made by [`enumeration!`](crate::enumeration).
    Enumeration,
}

impl fmt::Display for BaseType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

/// One value of an enumeration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Item {
    /// Its name.
    pub name: &'static str,
    /// The number that stands for it at the interface.
    pub value: i32,
    /// One sentence for the user.
    pub description: &'static str,
}

/// The type of a variable; if it has a name, it becomes a type definition.
///
/// ```
/// use fmu_export::{Type, units};
///
/// const STIFFNESS: Type = Type::real("Stiffness", &units::N_M_PER_RAD).min(0.0).nominal(100.0);
/// const COUNT: Type = Type::integer("Count").from(1).to(9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Type {
    /// Name, unlike any variable's; empty for a type that needs no definition.
    pub name: &'static str,
    /// What kind of value.
    pub of: Attributes,
}

/// What a type says besides its name.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Attributes {
    /// Of a floating-point number.
    Real {
        /// As in ISO 80000, for example `Angle`.
        quantity: &'static str,
        /// Unit of the values at the interface.
        unit: &'static Unit,
        /// Smallest value; enforced for parameters, a hint for the rest.
        min: Option<f64>,
        /// Largest value; enforced for parameters, a hint for the rest.
        max: Option<f64>,
        /// The order of magnitude of the values, for the scaling of solvers.
        nominal: Option<f64>,
    },
    /// Of a whole number, with its range, enforced for parameters.
    Integer {
        /// Smallest value.
        min: i32,
        /// Largest value.
        max: i32,
    },
    /// Of a truth value.
    Boolean,
    /// Of a text.
    String,
    /// Of one of these.
    Enumeration(&'static [Item]),
}

/// A number without unit.
pub const NUMBER: Type = Type::real("Number", &units::ONE);
/// A time in s.
pub const TIME: Type = Type::real("Time", &units::S);
/// A whole number of any size.
pub const INTEGER: Type = Type::integer("");
/// A truth value.
pub const BOOLEAN: Type = Type { name: "", of: Attributes::Boolean };
/// A text.
pub const STRING: Type = Type { name: "", of: Attributes::String };

impl Type {
    /// A physical quantity of this name in this unit, without range and nominal value.
    pub const fn real(name: &'static str, unit: &'static Unit) -> Self {
        Self { name, of: Attributes::Real { quantity: name, unit, min: None, max: None, nominal: None } }
    }

    /// A whole number.
    pub const fn integer(name: &'static str) -> Self {
        Self { name, of: Attributes::Integer { min: i32::MIN, max: i32::MAX } }
    }

    /// One of a list of names. [`enumeration!`](crate::enumeration) makes the list.
    pub const fn enumeration(name: &'static str, items: &'static [Item]) -> Self {
        Self { name, of: Attributes::Enumeration(items) }
    }

    /// With a smallest value, for a Real.
    #[must_use]
    pub const fn min(mut self, smallest: f64) -> Self {
        let Attributes::Real { min, .. } = &mut self.of else {
            panic!("min is for Reals; an Integer has from")
        };
        *min = Some(smallest);
        self
    }

    /// With a largest value, for a Real.
    #[must_use]
    pub const fn max(mut self, largest: f64) -> Self {
        let Attributes::Real { max, .. } = &mut self.of else {
            panic!("max is for Reals; an Integer has to")
        };
        *max = Some(largest);
        self
    }

    /// With an order of magnitude, for a Real.
    #[must_use]
    pub const fn nominal(mut self, magnitude: f64) -> Self {
        let Attributes::Real { nominal, .. } = &mut self.of else { panic!("nominal is for Reals") };
        *nominal = Some(magnitude);
        self
    }

    /// With a smallest value, for an Integer.
    #[must_use]
    pub const fn from(mut self, smallest: i32) -> Self {
        let Attributes::Integer { min, .. } = &mut self.of else { panic!("from is for Integers") };
        *min = smallest;
        self
    }

    /// With a largest value, for an Integer.
    #[must_use]
    pub const fn to(mut self, largest: i32) -> Self {
        let Attributes::Integer { max, .. } = &mut self.of else { panic!("to is for Integers") };
        *max = largest;
        self
    }

    /// The kind of value.
    pub const fn base(&self) -> BaseType {
        match self.of {
            Attributes::Real { .. } => BaseType::Real,
            Attributes::Integer { .. } => BaseType::Integer,
            Attributes::Boolean => BaseType::Boolean,
            Attributes::String => BaseType::String,
            Attributes::Enumeration(_) => BaseType::Enumeration,
        }
    }

    /// The nominal value of a Real, 1 if nothing else is said.
    pub const fn nominal_or_one(&self) -> f64 {
        match self.of {
            Attributes::Real { nominal: Some(nominal), .. } => nominal,
            _ => 1.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn builders_set_what_they_say() {
        let length = Type::real("Length", &units::ONE).min(-1.0).max(2.0).nominal(3.0);
        let Attributes::Real { quantity, unit, min, max, nominal } = length.of else {
            panic!("it is a Real")
        };
        assert_eq!(
            (quantity, unit, min, max, nominal),
            ("Length", &units::ONE, Some(-1.0), Some(2.0), Some(3.0))
        );
        assert_eq!(
            (length.nominal_or_one(), NUMBER.nominal_or_one(), STRING.nominal_or_one()),
            (3.0, 1.0, 1.0)
        );
        assert_eq!(Type::integer("Count").from(-1).to(9).of, Attributes::Integer { min: -1, max: 9 });
        assert_eq!(INTEGER.of, Attributes::Integer { min: i32::MIN, max: i32::MAX });
    }

    #[test]
    fn kinds_and_their_names() {
        const ITEMS: &[Item] = &[Item { name: "One", value: 1, description: "" }];
        for (of, base, name) in [
            (NUMBER, BaseType::Real, "Real"),
            (INTEGER, BaseType::Integer, "Integer"),
            (BOOLEAN, BaseType::Boolean, "Boolean"),
            (STRING, BaseType::String, "String"),
            (Type::enumeration("One", ITEMS), BaseType::Enumeration, "Enumeration"),
        ] {
            assert_eq!((of.base(), of.base().to_string().as_str()), (base, name));
        }
    }
}
