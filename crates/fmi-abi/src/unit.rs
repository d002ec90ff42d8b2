//! Units (section 2.2.2 of FMI 2.0, 2.4.3 of FMI 3.0).

use std::fmt;

/// Names of the base units, in the order of the exponents of a [`BaseUnit`].
pub const BASE_UNITS: [&str; 8] = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"];

/// A unit in terms of base units: value in base units = `factor` * value in the unit + `offset`.
///
/// ```
/// use fmi_abi::BaseUnit;
///
/// let celsius = BaseUnit { exponents: [0, 0, 0, 0, 1, 0, 0, 0], factor: 1.0, offset: 273.15 };
/// assert_eq!(celsius.to_string(), "1 K + 273.15");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseUnit {
    /// Exponents of the [`BASE_UNITS`].
    pub exponents: [i32; BASE_UNITS.len()],
    /// Factor by which a value in this unit is multiplied.
    pub factor: f64,
    /// Offset that is added after the multiplication.
    pub offset: f64,
}

/// A display unit: the displayed value is `factor` * value + `offset`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplayUnit<Name = String> {
    /// Name, for example `deg`.
    pub name: Name,
    /// Factor by which the value is multiplied.
    pub factor: f64,
    /// Offset that is added after the multiplication.
    pub offset: f64,
}

/// A unit of a model description, which has a name there.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Unit {
    /// Definition in base units, if given.
    pub base: Option<BaseUnit>,
    /// Units in which tools show the values.
    pub display_units: Vec<DisplayUnit>,
}

impl BaseUnit {
    /// Reads an element `BaseUnit`.
    ///
    /// # Errors
    /// Fails if an attribute is not a number. The message names it.
    #[cfg(feature = "description")]
    pub fn read(node: roxmltree::Node) -> Result<Self, String> {
        let mut unit = Self::ONE;
        for (name, exponent) in BASE_UNITS.into_iter().zip(&mut unit.exponents) {
            *exponent = crate::xml::attribute(node, name)?.unwrap_or(0);
        }
        unit.factor = crate::xml::attribute(node, "factor")?.unwrap_or(1.0);
        unit.offset = crate::xml::attribute(node, "offset")?.unwrap_or(0.0);
        Ok(unit)
    }

    /// Dimensionless, with the factor 1.
    pub const ONE: Self = Self { exponents: [0; BASE_UNITS.len()], factor: 1.0, offset: 0.0 };

    /// Returns the names and values of the attributes in a model description. Those with the default value are left out.
    pub fn attributes(&self) -> Vec<(&'static str, String)> {
        let exponents = self.named().map(|(name, exponent)| (name, exponent.to_string()));
        let factor = (self.factor != 1.0).then(|| ("factor", self.factor.to_string()));
        let offset = (self.offset != 0.0).then(|| ("offset", self.offset.to_string()));
        exponents.chain(factor).chain(offset).collect()
    }

    /// Returns the XML element with this name, which is `BaseUnit` in model descriptions.
    #[cfg(feature = "write")]
    pub fn element(&self, name: &str) -> crate::write::Element {
        let element = crate::write::Element::new(name);
        self.attributes().into_iter().fold(element, |element, (name, value)| element.with(name, value))
    }

    /// Returns factor and offset of the conversion of values in this unit to another one; `None` if they measure different quantities.
    pub fn conversion_to(&self, other: &Self) -> Option<(f64, f64)> {
        if self.equals(other) {
            return Some((1.0, 0.0));
        }
        let conversion = (self.factor / other.factor, (self.offset - other.offset) / other.factor);
        (self.exponents == other.exponents).then_some(conversion)
    }

    /// Returns whether both units are the same up to rounding: some tools write factors with only seven digits.
    pub fn equals(&self, other: &Self) -> bool {
        /// Largest relative difference that is not a difference.
        const SAME: f64 = 1e-6;
        let same = |one: f64, other: f64| (one - other).abs() <= SAME * one.abs().max(other.abs());
        self.exponents == other.exponents
            && same(self.factor, other.factor)
            && same(self.offset, other.offset)
    }

    /// Returns the unit of a difference of quantities, which has no offset.
    #[must_use]
    pub fn of_difference(self) -> Self {
        Self { offset: 0.0, ..self }
    }

    /// Returns the unit without the radian, which many definitions leave out.
    #[must_use]
    pub fn without_radian(mut self) -> Self {
        self.exponents[BASE_UNITS.len() - 1] = 0;
        self
    }

    /// The base units whose exponents are not 0.
    fn named(&self) -> impl Iterator<Item = (&'static str, i32)> {
        BASE_UNITS.into_iter().zip(self.exponents).filter(|(_, exponent)| *exponent != 0)
    }

    /// Returns the exponents as tools write them, such as `kg.m2.s-2`; empty if all are 0.
    pub fn symbol(&self) -> String {
        let one = |(name, exponent)| match exponent {
            1 => String::from(name),
            _ => format!("{name}{exponent}"),
        };
        self.named().map(one).collect::<Vec<_>>().join(".")
    }
}

/// Writes the unit as a multiple of base units, such as `1000 kg.m2.s-2`.
impl fmt::Display for BaseUnit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.factor)?;
        let symbol = self.symbol();
        if !symbol.is_empty() {
            write!(f, " {symbol}")?;
        }
        if self.offset != 0.0 {
            write!(f, " + {}", self.offset)?;
        }
        Ok(())
    }
}
