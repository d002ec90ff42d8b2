//! The parameters of the testbed (Table 1 of the paper), in SI units.

use std::fmt;

/// Inertias, stiffnesses, damping coefficients and the numbers of cam lobes and rollers.
#[allow(non_snake_case, reason = "the paper's symbols")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Inertia of a roller-carrier with rollers and shafts, kg.m2.
    pub J2: f64,
    /// Inertia of the load about the roll axis, kg.m2.
    pub J3: f64,
    /// Inertia of the load about the pitch axis, kg.m2.
    pub H3: f64,
    /// Stiffness of couplings 1 and 3 (motor side), N.m/rad.
    pub k1: f64,
    /// Stiffness of couplings 2 and 4 (SECT side), N.m/rad.
    pub k2: f64,
    /// Damping of couplings 1 and 3, N.m.s/rad.
    pub c1: f64,
    /// Damping of couplings 2 and 4, N.m.s/rad.
    pub c2: f64,
    /// Damping of the load in pitch and in roll, N.m.s/rad.
    pub c3: f64,
    /// Number of lobes of the spherical cams.
    pub M: i32,
    /// Number of rollers on each side of the roller-carriers.
    pub N: i32,
}

impl Parameters {
    /// Table 1, or what the library was built with instead; read from `modelDescription/parameters.json`
    /// when it is compiled.
    pub const BUILT_IN: Self = include!(concat!(env!("OUT_DIR"), "/table_1.rs"));

    /// Transmission ratio from the motors' difference to roll: N / 2M of eq. (1).
    pub fn roll_ratio(&self) -> f64 {
        f64::from(self.N) / (2.0 * f64::from(self.M))
    }

    /// Checks the ranges in which the equations make sense.
    ///
    /// # Errors
    /// Names the parameter and what it must be.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        let positive = [("J2", self.J2), ("J3", self.J3), ("H3", self.H3), ("k1", self.k1), ("k2", self.k2)];
        for (name, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(InvalidParameter(format!("{name} must be > 0, it is {value}")));
            }
        }
        for (name, value) in [("c1", self.c1), ("c2", self.c2), ("c3", self.c3)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(InvalidParameter(format!("{name} must be >= 0, it is {value}")));
            }
        }
        if self.c1 + self.c2 <= 0.0 {
            return Err(InvalidParameter(
                "c1 and c2 must not both be 0: the massless shafts between the couplings need damping; \
                 set the larger one first or both in one call"
                    .into(),
            ));
        }
        for (name, value) in [("M", self.M), ("N", self.N)] {
            if value < 1 {
                return Err(InvalidParameter(format!("{name} must be >= 1, it is {value}")));
            }
        }
        Ok(())
    }
}

/// Why a set of parameters makes no testbed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InvalidParameter(pub(crate) String);

impl fmt::Display for InvalidParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for InvalidParameter {}
