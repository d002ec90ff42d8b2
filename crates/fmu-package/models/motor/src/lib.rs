//! A DC motor at a switched voltage as an FMU, for Co-Simulation and Model Exchange.

mod motor;

pub use motor::{Motor, Name};

fmu_export::export_fmu!(Motor: CoSimulation + ModelExchange);
