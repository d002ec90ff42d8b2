//! A controller for the pitch-roll wrist testbed, and the FMU made of it.
//!
//! [`Controller`] moves the testbed's two motors so that the wrist takes the pitch and the roll it is told:
//! the inverse of eq. (1) as feed-forward, PI correction from measured pitch and roll, limits on the motors'
//! rate, acceleration and torque. It knows no FMI; `fmu.rs` and the table of [`variables`] do.

pub mod controller;
mod fmu;
pub mod motor;
pub mod parameters;
#[cfg(feature = "packaging")]
pub mod sources;
pub mod variables;
pub mod wrist;

pub use controller::Controller;
pub use fmu::ControllerFmu;
pub use parameters::Parameters;

fmi2_export::export_fmi2!(ControllerFmu);
