//! Units (section 2.2.2 of FMI 2.0, 2.4.3 of FMI 3.0), and constants for the most frequent units of mechanics, for
//! use in a [`Type`](crate::Type). The display unit of angles is the degree.

pub use fmi_abi::{BaseUnit, DisplayUnit};
use std::f64::consts::PI;

/// A unit: exponents of the SI base units and of rad, with factor and offset.
///
/// ```
/// use fmu_export::Unit;
///
/// const VOLT: Unit = Unit::new("V").kg(1).m(2).s(-3).A(-1);
/// const CELSIUS: Unit = Unit::new("degC").K(1).offset(273.15).display("degF", 1.8, 32.0);
/// assert_eq!(CELSIUS.base.offset, 273.15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Name, for example `N.m/rad`.
    pub name: &'static str,
    /// Definition in base units.
    pub base: BaseUnit,
    /// Unit in which tools show the values.
    pub display: Option<DisplayUnit<&'static str>>,
}

/// Defines a method for the exponent of each base unit, which is at an index of `fmi_abi::BASE_UNITS`.
macro_rules! exponents {
    ($($index:literal $unit:ident)+) => {
        $(
            #[doc = concat!("Sets the exponent of ", stringify!($unit), ".")]
            #[allow(non_snake_case, reason = "the symbols of the units")]
            #[must_use]
            pub const fn $unit(mut self, exponent: i32) -> Self {
                self.base.exponents[$index] = exponent;
                self
            }
        )+
    };
}

impl Unit {
    /// Creates a dimensionless unit of this name.
    pub const fn new(name: &'static str) -> Self {
        Self { name, base: BaseUnit::ONE, display: None }
    }

    exponents!(0 kg 1 m 2 s 3 A 4 K 5 mol 6 cd 7 rad);

    /// Sets the factor of the conversion to base units.
    #[must_use]
    pub const fn factor(mut self, factor: f64) -> Self {
        self.base.factor = factor;
        self
    }

    /// Sets the offset of the conversion to base units.
    #[must_use]
    pub const fn offset(mut self, offset: f64) -> Self {
        self.base.offset = offset;
        self
    }

    /// Sets the display unit; the displayed value is `factor * value + offset`.
    #[must_use]
    pub const fn display(mut self, name: &'static str, factor: f64, offset: f64) -> Self {
        self.display = Some(DisplayUnit { name, factor, offset });
        self
    }
}

const DEG_PER_RAD: f64 = 180.0 / PI;
const RAD_PER_DEG: f64 = PI / 180.0;

/// Dimensionless.
pub const ONE: Unit = Unit::new("1");
/// Second.
pub const S: Unit = Unit::new("s").s(1);
/// Per second.
pub const PER_S: Unit = Unit::new("1/s").s(-1);
/// Angle.
pub const RAD: Unit = Unit::new("rad").rad(1).display("deg", DEG_PER_RAD, 0.0);
/// Angular velocity.
pub const RAD_PER_S: Unit = Unit::new("rad/s").s(-1).rad(1).display("deg/s", DEG_PER_RAD, 0.0);
/// Angular acceleration.
pub const RAD_PER_S2: Unit = Unit::new("rad/s2").s(-2).rad(1).display("deg/s2", DEG_PER_RAD, 0.0);
/// Torque.
pub const N_M: Unit = Unit::new("N.m").kg(1).m(2).s(-2);
/// Moment of inertia.
pub const KG_M2: Unit = Unit::new("kg.m2").kg(1).m(2);
/// Torsional stiffness.
pub const N_M_PER_RAD: Unit =
    Unit::new("N.m/rad").kg(1).m(2).s(-2).rad(-1).display("N.m/deg", RAD_PER_DEG, 0.0);
/// Torsional damping.
pub const N_M_S_PER_RAD: Unit =
    Unit::new("N.m.s/rad").kg(1).m(2).s(-1).rad(-1).display("N.m.s/deg", RAD_PER_DEG, 0.0);

#[cfg(test)]
mod tests {
    use super::*;

    /// Converts a right angle, and a stiffness of 1 N m per degree.
    #[test]
    fn angles_are_displayed_in_degrees() {
        let shown =
            |unit: Unit, value: f64| unit.display.map(|display| display.factor * value + display.offset);
        assert_eq!(shown(RAD, PI / 2.0), Some(90.0));
        assert!((shown(N_M_PER_RAD, 180.0 / PI).unwrap() - 1.0).abs() < 1e-15);
        assert_eq!(shown(ONE, 1.0), None);
    }
}
