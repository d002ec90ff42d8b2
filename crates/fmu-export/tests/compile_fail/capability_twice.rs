//! A capability is named once.
include!("toy/model.rs");

offer!(Toy: CoSimulation + CoSimulation);
