//! A heated house as an FMU, for Co-Simulation and Model Exchange.

mod house;

pub use house::{House, Name};

fmu_export::export_fmu!(House: CoSimulation + ModelExchange);
