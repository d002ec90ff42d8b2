//! The McGill pitch-roll wrist testbed: model, exact stepping, and the FMU made of them.

pub mod decoupled;
pub mod energies;
#[cfg(feature = "packaging")]
pub mod fingerprint;
mod fmu;
pub mod motor;
#[cfg(feature = "packaging")]
pub mod parameter_file;
pub mod parameters;
pub mod propagator;
pub mod state_space;
pub mod testbed;
pub mod variables;

pub use fmu::TestbedFmu;
pub use parameters::Parameters;
pub use testbed::Testbed;

fmi2_export::export_fmi2!(TestbedFmu);
