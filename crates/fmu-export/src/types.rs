//! Types of variables: what kind of value, in which unit, in which range.

use crate::units::{self, Unit};
use fmi_abi::BaseType;

/// The whole number, if this kind has it; an error when compiling otherwise.
const fn has(base: BaseType, number: i128) -> i128 {
    match base.range() {
        Some((min, max)) if min <= number && number <= max => number,
        _ => panic!("this kind of number has no such value"),
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
/// const COUNT: Type = Type::integer("Count").min_integer(1).max_integer(9);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Type {
    /// Name, unlike any variable's; empty for a type that needs no definition.
    pub name: &'static str,
    /// What it says of its values.
    pub attributes: Attributes,
    /// What kind of value.
    pub base: BaseType,
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
        /// Smallest value; that of the kind of number if nothing else is said.
        min: i128,
        /// Largest value; that of the kind of number if nothing else is said.
        max: i128,
    },
    /// Of a truth value.
    Boolean,
    /// Of a text.
    String,
    /// Of bytes.
    Binary {
        /// What they are, for example `image/png`.
        mime_type: &'static str,
        /// The largest number of them, enforced for all that importers set.
        max_size: usize,
    },
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
pub const BOOLEAN: Type = Type { name: "", attributes: Attributes::Boolean, base: BaseType::Boolean };
/// A text.
pub const STRING: Type = Type { name: "", attributes: Attributes::String, base: BaseType::String };
/// Bytes of any meaning.
pub const BINARY: Type = Type::binary("", "application/octet-stream");

impl Type {
    /// A physical quantity of this name in this unit, without range and nominal value; [`quantity`](Self::quantity) gives it another
    /// name than the type.
    pub const fn real(name: &'static str, unit: &'static Unit) -> Self {
        let attributes = Attributes::Real { quantity: name, unit, min: None, max: None, nominal: None };
        Self { name, attributes, base: BaseType::Real }
    }

    /// The same in single precision.
    pub const fn float32(name: &'static str, unit: &'static Unit) -> Self {
        Self { base: BaseType::Float32, ..Self::real(name, unit) }
    }

    /// A whole number.
    pub const fn integer(name: &'static str) -> Self {
        Self::whole(name, BaseType::Integer)
    }

    /// A whole number of a kind, such as [`BaseType::UInt16`].
    #[track_caller]
    pub const fn whole(name: &'static str, base: BaseType) -> Self {
        let Some((min, max)) = base.range() else { panic!("this kind of value is no whole number") };
        Self { name, attributes: Attributes::Integer { min, max }, base }
    }

    /// Bytes of a MIME type, at most a mebibyte of them.
    pub const fn binary(name: &'static str, mime_type: &'static str) -> Self {
        let attributes = Attributes::Binary { mime_type, max_size: 1 << 20 };
        Self { name, attributes, base: BaseType::Binary }
    }

    /// One of a list of names. [`enumeration!`](crate::enumeration) makes the list.
    pub const fn enumeration(name: &'static str, items: &'static [Item]) -> Self {
        Self { name, attributes: Attributes::Enumeration(items), base: BaseType::Enumeration }
    }

    /// With the quantity that it is of, for a Real, where that is not its name: `Velocity` for a type `Speed`.
    #[must_use]
    #[track_caller]
    pub const fn quantity(mut self, name: &'static str) -> Self {
        let Attributes::Real { quantity, .. } = &mut self.attributes else { panic!("quantity is for Reals") };
        *quantity = name;
        self
    }

    /// With a smallest value, for a Real.
    #[must_use]
    #[track_caller]
    pub const fn min(mut self, smallest: f64) -> Self {
        let Attributes::Real { min, .. } = &mut self.attributes else {
            panic!("min is for Reals; whole numbers have min_integer")
        };
        *min = Some(smallest);
        self
    }

    /// With a largest value, for a Real.
    #[must_use]
    #[track_caller]
    pub const fn max(mut self, largest: f64) -> Self {
        let Attributes::Real { max, .. } = &mut self.attributes else {
            panic!("max is for Reals; whole numbers have max_integer")
        };
        *max = Some(largest);
        self
    }

    /// With an order of magnitude, for a Real.
    #[must_use]
    #[track_caller]
    pub const fn nominal(mut self, magnitude: f64) -> Self {
        let Attributes::Real { nominal, .. } = &mut self.attributes else { panic!("nominal is for Reals") };
        *nominal = Some(magnitude);
        self
    }

    /// With a smallest value, for a whole number.
    #[must_use]
    #[track_caller]
    pub const fn min_integer(mut self, smallest: i128) -> Self {
        let base = self.base;
        let Attributes::Integer { min, .. } = &mut self.attributes else {
            panic!("min_integer is for whole numbers")
        };
        *min = has(base, smallest);
        self
    }

    /// With a largest value, for a whole number.
    #[must_use]
    #[track_caller]
    pub const fn max_integer(mut self, largest: i128) -> Self {
        let base = self.base;
        let Attributes::Integer { max, .. } = &mut self.attributes else {
            panic!("max_integer is for whole numbers")
        };
        *max = has(base, largest);
        self
    }

    /// With a largest number of bytes, at most a mebibyte.
    #[must_use]
    #[track_caller]
    pub const fn max_size(mut self, largest: usize) -> Self {
        let Attributes::Binary { max_size, .. } = &mut self.attributes else {
            panic!("max_size is for Binary")
        };
        assert!(largest <= *max_size, "max_size: a mebibyte is the largest");
        *max_size = largest;
        self
    }

    /// The kind of value.
    pub const fn base(&self) -> BaseType {
        self.base
    }

    /// The nominal value of a Real, 1 if nothing else is said.
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
    fn builders_set_what_they_say() {
        let length = Type::real("Length", &units::ONE).min(-1.0).max(2.0).nominal(3.0);
        let Attributes::Real { quantity, unit, min, max, nominal } = length.attributes else {
            panic!("it is a Real")
        };
        assert_eq!(
            (quantity, unit, min, max, nominal),
            ("Length", &units::ONE, Some(-1.0), Some(2.0), Some(3.0))
        );
        let width = length.quantity("Width");
        assert!(
            matches!(width.attributes, Attributes::Real { quantity: "Width", .. }) && width.name == "Length"
        );
        assert_eq!(
            (length.nominal_or_one(), NUMBER.nominal_or_one(), STRING.nominal_or_one()),
            (3.0, 1.0, 1.0)
        );
        assert_eq!(
            Type::integer("Count").min_integer(-1).max_integer(9).attributes,
            Attributes::Integer { min: -1, max: 9 }
        );
        assert_eq!(INTEGER.attributes, Attributes::Integer { min: i32::MIN.into(), max: i32::MAX.into() });
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
