//! Parameters of the controller and their ranges.

use fmu_export::Error;

/// Smallest value of a parameter that must be positive. Together with [`LARGEST`], it ensures that products and
/// quotients of parameters do not overflow.
pub const SMALLEST: f64 = 1e-9;
/// Largest value of a Real parameter; see [`SMALLEST`].
pub const LARGEST: f64 = 1e9;

/// Sample time, limits of the motors, gains, and the assumed properties of the wrist.
#[allow(non_snake_case, reason = "the names control engineers use, and the paper's symbols")]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// Time between samples, s.
    pub sample_time: f64,
    /// Highest rate of a motor, rad/s.
    pub max_rate: f64,
    /// Highest acceleration of a motor, rad/s2.
    pub max_acceleration: f64,
    /// Torque limit of a motor, N.m.
    pub max_torque: f64,
    /// Assumed stiffness between motor and wrist, for torque limiting, N.m/rad.
    pub stiffness: f64,
    /// Proportional gain.
    pub Kp: f64,
    /// Integral gain, 1/s.
    pub Ki: f64,
    /// Gain of the measured rates, which damps vibration of the couplings, s.
    pub Kd: f64,
    /// Largest correction of pitch and of roll, rad.
    pub max_correction: f64,
    /// Number of lobes of the spherical cams.
    pub M: i32,
    /// Number of rollers on each side of the roller-carriers.
    pub N: i32,
}

impl Parameters {
    /// Default parameters, for the testbed with Table 1.
    pub const DEFAULT: Self = Self {
        sample_time: 1e-3,
        max_rate: 3.0,
        max_acceleration: 30.0,
        max_torque: 10.0,
        // Two couplings in series: k1 k2 / (k1 + k2) = 32.01 N.m/rad.
        stiffness: 32.0,
        Kp: 0.1,
        Ki: 3.0,
        Kd: 0.01,
        max_correction: 0.2,
        M: 4,
        N: 7,
    };

    /// Checks that the parameters are in the ranges in which the control law is valid.
    ///
    /// # Errors
    /// The message names the parameter and its valid range.
    pub fn check(&self) -> Result<(), Error> {
        for (name, value) in [
            ("sample_time", self.sample_time),
            ("max_rate", self.max_rate),
            ("max_acceleration", self.max_acceleration),
            ("max_torque", self.max_torque),
            ("stiffness", self.stiffness),
        ] {
            if !(SMALLEST..=LARGEST).contains(&value) {
                return Err(Error::new(format!(
                    "{name} must be between {SMALLEST:e} and {LARGEST:e}, it is {value}"
                )));
            }
        }
        for (name, value) in
            [("Kp", self.Kp), ("Ki", self.Ki), ("Kd", self.Kd), ("max_correction", self.max_correction)]
        {
            if !(0.0..=LARGEST).contains(&value) {
                return Err(Error::new(format!("{name} must be between 0 and {LARGEST:e}, it is {value}")));
            }
        }
        if self.Ki * self.sample_time > 1.0 {
            return Err(Error::new(format!(
                "Ki * sample_time must not exceed 1, or the integral oscillates from sample to sample; it is {}",
                self.Ki * self.sample_time
            )));
        }
        for (name, value) in [("M", self.M), ("N", self.N)] {
            if value < 1 {
                return Err(Error::new(format!("{name} must be >= 1, it is {value}")));
            }
        }
        Ok(())
    }
}
