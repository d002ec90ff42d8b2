//! The McGill pitch-roll wrist testbed: its equations, their exact solution from one communication point to
//! the next, and the FMU made from them.
//!
//! Two motors turn by theta1 and theta2. Each motor drives one of the two input shafts (theta5, theta6) of the
//! spherical epicyclic cam train (SECT). Between motor and input shaft are a torque sensor and two flexible
//! couplings. A massless shaft (theta3, theta4) connects the two couplings. The output shaft of the SECT
//! pitches (theta7) and rolls (theta8).
//!
//! The modules are listed in the order of the derivation in the paper, *Modelling and Simulation of the Testbed
//! for a Pitch-Roll Wrist Prototype Based on Spherical Cam-Rollers*. The paper covers the first three; [`motor`]
//! and all later ones are additions of this project:
//!
//! 1. [`parameters`]: inertias, stiffnesses, damping (Table 1).
//! 2. [`energies`]: the kinematics of the SECT, eq. (1); kinetic energy, eqs. (3) to (5); potential energy,
//!    eq. (6); dissipation, eq. (7).
//! 3. [`state_space`]: the matrices that follow from Lagrange's equation, eq. (2). Eq. (8) is
//!    `M q'' + Delta q' + K q = f`. The shafts between the couplings have no mass, so their rows are of first
//!    order. Solving these rows for the rates `q_I'` of the shafts gives a system of six states, eq. (11). Its
//!    outputs include the sensor torques, eqs. (9) and (10). The transfer matrices are G(s), eqs. (12) and (13),
//!    and H(s), eqs. (14) and (15).
//! 4. [`motor`]: the motion of a motor between samples of its angle.
//! 5. [`decoupled`]: the same equations, split into pitch (the mean of the two sides) and roll (half their
//!    difference). Pitch and roll do not influence each other; a [`pair`] stores both.
//! 6. [`propagator`]: the exact solution over one step during which the motor angles change linearly; its
//!    matrices are computed with the scaling of [`balance`] and the number types of [`number`].
//! 7. [`testbed`]: motors and state, advanced from one communication point to the next.
//! 8. [`instant`]: torques, rates and accelerations at one instant, and their derivatives with respect to the
//!    parameters.
//! 9. [`start`]: the state at the start of the simulation.
//! 10. [`TestbedFmu`] and [`variables`]: names and units of the variables, and the capabilities of the FMU.
//!
//! Some printed equations are wrong; the documentation of the corresponding function describes each correction.
//!
//! ```
//! use prw_testbed::{BUILT_IN, Testbed};
//!
//! // Both motors at 1 rad/s: the wrist pitches and does not roll.
//! let mut testbed = Testbed::new(BUILT_IN)?;
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

pub mod balance;
mod capabilities;
pub mod decoupled;
pub mod energies;
mod fmu;
pub mod instant;
pub mod motor;
pub mod number;
pub mod pair;
pub mod parameters;
pub mod propagator;
pub mod start;
pub mod state_space;
pub mod testbed;
pub mod variables;

pub use fmu::TestbedFmu;
pub use parameters::Parameters;
pub use testbed::Testbed;

/// The built-in parameters, Table 1. The build script reads them from `modelDescription/parameters.json`.
pub const BUILT_IN: Parameters = include!(concat!(env!("OUT_DIR"), "/table_1.rs"));

fmu_export::export_fmu!(
    TestbedFmu: CoSimulation + FastSteps + ModelExchange + InputDerivatives + OutputDerivatives + Partials
);
