//! There are five capabilities.
include!("toy/model.rs");

offer!(Toy: CoSimulation + Magic);
