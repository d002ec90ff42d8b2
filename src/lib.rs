//! The McGill pitch-roll wrist testbed: its equations, their exact solution from one communication point
//! to the next, and the FMU made of them.
//!
//! Two motors turn by theta1 and theta2. Each drives, through a torque sensor and two flexible couplings
//! with a massless shaft between them (theta3, theta4), an input shaft of the spherical epicyclic cam train
//! (SECT; theta5, theta6), whose output shaft pitches (theta7) and rolls (theta8). Read in this order, the
//! modules are the derivation of the paper, *Modelling and Simulation of the Testbed for a Pitch-Roll Wrist
//! Prototype Based on Spherical Cam-Rollers*, and what the project adds to it:
//!
//! 1. [`parameters`]: inertias, stiffnesses, damping (Table 1).
//! 2. [`energies`]: what the SECT does to motions, eq. (1); kinetic energy, eqs. (3) to (5); potential
//!    energy, eq. (6); dissipation, eq. (7).
//! 3. [`state_space`]: Lagrange's equation, eq. (2), makes of them `M q'' + Delta q' + K q = f`, eq. (8).
//!    The shafts between the couplings have no mass, so their rows are of first order; solved for
//!    `q_I'` they leave six states, eq. (11), with the sensor torques, eqs. (9) and (10), as outputs. Then
//!    the transfer matrices G(s), eqs. (12) and (13), and H(s), eqs. (14) and (15).
//! 4. [`motor`]: what is known of a motor between samples of its angle.
//! 5. [`decoupled`]: the same equations for the mean and the half difference of the two sides, pitch and
//!    roll, which do not influence each other.
//! 6. [`propagator`]: their solution over a step on which the motors move on straight lines.
//! 7. [`testbed`]: motors and state, advanced from point to point.
//! 8. [`instant`]: torques, rates and accelerations at one instant, and how they react to the parameters.
//! 9. [`start`]: where the motion begins.
//! 10. [`TestbedFmu`] and [`variables`]: the names and units that an importer sees, and what the FMU offers.
//!
//! Where the printed equations are wrong, the item that mends them says so.
//!
//! ```
//! use prw_testbed::{Parameters, Testbed};
//!
//! // Both motors at 1 rad/s: the wrist pitches and does not roll.
//! let mut testbed = Testbed::new(Parameters::BUILT_IN)?;
//! for i in 0..2000 {
//!     for motor in 0..2 {
//!         testbed.motors.set_theta(motor, 1e-3 * f64::from(i));
//!         testbed.motors.set_rate(motor, 1.0);
//!     }
//!     assert!(testbed.step(1e-3));
//! }
//! let [_, _, theta5, theta6, omega5, _] = testbed.state;
//! assert_eq!(theta5, theta6);
//! assert!((omega5 - 1.0).abs() < 1e-6);
//! # Ok::<(), prw_testbed::parameters::InvalidParameter>(())
//! ```

mod capabilities;
pub mod decoupled;
pub mod energies;
mod fmu;
pub mod instant;
pub mod motor;
pub mod number;
pub mod pair;
#[cfg(test)]
mod parameter_file;
pub mod parameters;
pub mod propagator;
pub mod start;
pub mod state_space;
pub mod testbed;
pub mod variables;

pub use fmu::TestbedFmu;
pub use parameters::Parameters;
pub use testbed::Testbed;

impl Parameters {
    /// Table 1, or what the library was built with instead; read from `modelDescription/parameters.json`
    /// when it is compiled.
    pub const BUILT_IN: Self = include!(concat!(env!("OUT_DIR"), "/table_1.rs"));
}

fmu_export::export_fmu!(
    TestbedFmu: CoSimulation + ModelExchange + InputDerivatives + OutputDerivatives + Partials
);
