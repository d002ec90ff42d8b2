//! A bouncing ball as an FMU, for Co-Simulation and Model Exchange.

mod ball;

pub use ball::{Ball, Name};

fmu_export::export_fmu!(Ball: CoSimulation + ModelExchange);
