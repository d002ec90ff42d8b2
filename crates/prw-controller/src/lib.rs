//! A controller for the pitch-roll wrist testbed, and the FMU made from it.
//!
//! [`Controller`] moves the two motors of the testbed so that the wrist reaches a reference pitch and roll.
//! The inverse of eq. (1) gives a feed-forward, and a PI control of measured pitch and roll corrects it.
//! Rate, acceleration and torque of the motors are limited. The table of [`variables`] and `fmu.rs` make the
//! FMU; the other modules do not depend on FMI.

pub mod controller;
mod fmu;
pub mod motor;
pub mod parameters;
pub mod variables;
pub mod wrist;

pub use controller::Controller;
pub use parameters::Parameters;

fmu_export::export_fmu!(Controller: CoSimulation + ModelExchange + InputDerivatives + OutputDerivatives + Partials);
