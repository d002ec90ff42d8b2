//! Units (section 2.2.2), those of rotary mechanics ready to use in a [`RealType`](crate::RealType). People
//! see angles in degrees.

use std::f64::consts::PI;

/// A unit (section 2.2.2).
#[derive(Debug, PartialEq)]
pub struct Unit {
    /// Name, for example `N.m/rad`.
    pub name: &'static str,
    /// Exponents of kg, m, s and rad.
    pub base: BaseUnit,
    /// The unit a person prefers, with display value = factor * value.
    pub display: Option<DisplayUnit>,
}

/// Exponents of the base units that mechanics needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaseUnit {
    /// Exponent of kg.
    pub kg: i32,
    /// Exponent of m.
    pub m: i32,
    /// Exponent of s.
    pub s: i32,
    /// Exponent of rad.
    pub rad: i32,
}

/// A unit to show values in: display value = factor * value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplayUnit {
    /// Name, for example `deg`.
    pub name: &'static str,
    /// Multiplies the value.
    pub factor: f64,
}

const DEG_PER_RAD: f64 = 180.0 / PI;
const RAD_PER_DEG: f64 = PI / 180.0;

const fn unit(name: &'static str, [kg, m, s, rad]: [i32; 4], display: Option<DisplayUnit>) -> Unit {
    Unit { name, base: BaseUnit { kg, m, s, rad }, display }
}

const fn display(name: &'static str, factor: f64) -> Option<DisplayUnit> {
    Some(DisplayUnit { name, factor })
}

/// A number.
pub const ONE: Unit = unit("1", [0, 0, 0, 0], None);
/// Second.
pub const S: Unit = unit("s", [0, 0, 1, 0], None);
/// Per second.
pub const PER_S: Unit = unit("1/s", [0, 0, -1, 0], None);
/// Angle.
pub const RAD: Unit = unit("rad", [0, 0, 0, 1], display("deg", DEG_PER_RAD));
/// Angular velocity.
pub const RAD_PER_S: Unit = unit("rad/s", [0, 0, -1, 1], display("deg/s", DEG_PER_RAD));
/// Angular acceleration.
pub const RAD_PER_S2: Unit = unit("rad/s2", [0, 0, -2, 1], display("deg/s2", DEG_PER_RAD));
/// Torque.
pub const N_M: Unit = unit("N.m", [1, 2, -2, 0], None);
/// Moment of inertia.
pub const KG_M2: Unit = unit("kg.m2", [1, 2, 0, 0], None);
/// Torsional stiffness.
pub const N_M_PER_RAD: Unit = unit("N.m/rad", [1, 2, -2, -1], display("N.m/deg", RAD_PER_DEG));
/// Torsional damping.
pub const N_M_S_PER_RAD: Unit = unit("N.m.s/rad", [1, 2, -1, -1], display("N.m.s/deg", RAD_PER_DEG));
