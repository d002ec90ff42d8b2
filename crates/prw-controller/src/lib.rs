//! A controller for the pitch-roll wrist testbed, and the FMU made of it.
//!
//! [`Controller`] moves the testbed's two motors so that the wrist takes the pitch and the roll it is told:
//! the inverse of eq. (1) as feed-forward, PI correction from measured pitch and roll, limits on the motors'
//! rate, acceleration and torque. The table of [`variables`] and `fmu.rs` make the FMU
//! of it; the rest knows no FMI.

pub mod controller;
mod fmu;
pub mod motor;
pub mod parameters;
pub mod variables;
pub mod wrist;

pub use controller::Controller;
pub use parameters::Parameters;

fmu_export::export_fmu!(Controller: CoSimulation + ModelExchange + InputDerivatives + OutputDerivatives + Partials);
