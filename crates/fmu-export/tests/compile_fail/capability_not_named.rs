//! A capability that is implemented is named.
include!("toy/model.rs");

impl ModelExchange for Toy {}

offer!(Toy: CoSimulation);
