//! The parameters of the testbed (Table 1 of the paper), in SI units.
//!
//! Three programs compile this module: the model, its build script, which compiles the values into the library, and `build_fmu`, which
//! writes them into the model description. The file with the values is read only while an FMU is built, so only the last two compile
//! `file.rs`, which reads it.

use std::fmt;

/// Type of a measured parameter; FMI 2.0 calls it Real.
pub type Real = f64;
/// Type of a counted parameter; FMI 2.0 calls it Integer.
pub type Integer = i32;

/// Passes the table of parameters to the macro `$make`: description, name, type, range and unit of each.
macro_rules! table {
    ($make:ident) => {
        $make! {
            /// Inertia of a roller-carrier with rollers and shafts.
            J2: Real > 0, "kg.m2";
            /// Inertia of the load about the roll axis.
            J3: Real > 0, "kg.m2";
            /// Inertia of the load about the pitch axis.
            H3: Real > 0, "kg.m2";
            /// Stiffness of couplings 1 and 3 (motor side).
            k1: Real > 0, "N.m/rad";
            /// Stiffness of couplings 2 and 4 (SECT side).
            k2: Real > 0, "N.m/rad";
            /// Damping of couplings 1 and 3.
            c1: Real >= 0, "N.m.s/rad";
            /// Damping of couplings 2 and 4.
            c2: Real >= 0, "N.m.s/rad";
            /// Damping of the load in pitch and in roll.
            c3: Real >= 0, "N.m.s/rad";
            /// Number of lobes of the spherical cams.
            M: Integer >= 1, "1";
            /// Number of rollers on each side of the roller-carriers.
            N: Integer >= 1, "1";
        }
    };
}

macro_rules! parameters {
    ($($(#[$meaning:meta])* $name:ident: $kind:ident $compare:tt $limit:literal, $unit:literal;)+) => {
        /// Inertias, stiffnesses, damping coefficients and the numbers of cam lobes and rollers.
        #[allow(non_snake_case, reason = "the paper's symbols")]
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct Parameters {
            $($(#[$meaning])* #[doc = concat!("\n\nUnit: ", $unit)] pub $name: $kind,)+
        }

        impl Parameters {
            /// Returns names and values of the parameters; the strings parse back to the same numbers.
            pub fn start_values(&self) -> Vec<(String, String)> {
                vec![$((stringify!($name).to_owned(), self.$name.to_string())),+]
            }

            /// All parameters 0. Used for the direction of a derivative, in which one parameter is then set to 1.
            pub const ZERO: Self = Self { $($name: 0 as $kind,)+ };

            /// Returns other parameters, for tests. In the order of Table 1, every Real parameter is multiplied by exp of the
            /// next exponent. A value of 0 would stay 0, so the largest value with its unit is used instead.
            #[must_use]
            pub fn varied(&self, mut exponent: impl FnMut() -> f64) -> Self {
                let values = [$(($unit, f64::from(self.$name))),+];
                let largest = |unit: &str| {
                    values.into_iter().filter(|(of, _)| *of == unit).fold(0.0, |most, (_, value)| value.max(most))
                };
                Self { $($name: self.$name.varied(largest($unit), &mut exponent),)+ }
            }

            fn check_ranges(&self) -> Result<(), InvalidParameter> {
                $(if !(f64::from(self.$name).is_finite() && self.$name $compare $kind::from($limit)) {
                    return Err(InvalidParameter(format!(
                        concat!(stringify!($name), " must be ", stringify!($compare), " ", $limit, ", it is {}"),
                        self.$name
                    )));
                })+
                Ok(())
            }
        }
    };
}
table!(parameters);

/// Varies a Real parameter, and leaves an Integer unchanged; see [`Parameters::varied`].
trait Varied {
    fn varied(self, instead_of_0: f64, exponent: &mut impl FnMut() -> f64) -> Self;
}

impl Varied for Real {
    fn varied(self, instead_of_0: f64, exponent: &mut impl FnMut() -> f64) -> Self {
        let value = if self == 0.0 { instead_of_0 } else { self };
        value * exponent().exp()
    }
}

impl Varied for Integer {
    fn varied(self, _: f64, _: &mut impl FnMut() -> f64) -> Self {
        self
    }
}

impl Parameters {
    /// Returns the transmission ratio from the difference theta5 - theta6 to roll, N / 2M of eq. (1).
    pub fn roll_ratio(&self) -> f64 {
        f64::from(self.N) / (2.0 * f64::from(self.M))
    }

    /// Checks that the parameters are in the ranges in which the equations are valid.
    ///
    /// # Errors
    /// The message names the invalid parameter and its range, or the two parameters that must not both be 0.
    pub fn check(&self) -> Result<(), InvalidParameter> {
        self.check_ranges()?;
        if self.c1 + self.c2 <= 0.0 {
            return Err(InvalidParameter(
                "c1 and c2 must not both be 0: the massless shafts between the couplings need damping; \
                 set the larger one first or both in one call"
                    .into(),
            ));
        }
        Ok(())
    }
}

/// Reason for which a set of parameters is invalid.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InvalidParameter(String);

impl InvalidParameter {
    /// Creates an error with this reason, which the FMU logs.
    pub fn new(reason: impl Into<String>) -> Self {
        Self(reason.into())
    }
}

impl fmt::Display for InvalidParameter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for InvalidParameter {}
