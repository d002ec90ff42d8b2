//! Tests of the C functions of both FMI versions with test models.
#![allow(missing_docs)]

use fmu_test_kit::models;

use fmu_export::{Exported, Interface};

/// Calls a function for every test model of this list.
macro_rules! for_every_model {
    ($function:ident $(, $importer:ty)?) => {{
        $function::<$($importer,)? crate::models::Oscillator>();
        $function::<$($importer,)? crate::models::Ball>();
        $function::<$($importer,)? crate::models::Counter>();
        $function::<$($importer,)? crate::models::Talker>();
        $function::<$($importer,)? crate::models::Fuse>();
        $function::<$($importer,)? crate::models::Motor>();
        $function::<$($importer,)? crate::models::Lazy>();
        $function::<$($importer,)? crate::models::Meter>();
    }};
}

mod arrays;
mod calculated;
mod call_table;
mod derivatives;
mod events;
mod experiment;
mod indices;
mod logging;
mod rejections;
mod runs;
mod saved_states;
mod settable;
mod simulation;
mod start_values;
mod tolerances;
mod undone;
mod valid_calls;
mod variables;

const INTERFACES: [Interface; 2] = [Interface::CoSimulation, Interface::ModelExchange];

/// Returns whether the model supports an interface type.
fn offers<M: Exported>(interface: Interface) -> bool {
    match interface {
        Interface::CoSimulation => M::CO_SIMULATION.is_some(),
        Interface::ModelExchange => M::MODEL_EXCHANGE.is_some(),
    }
}

/// The checks of the test kit that every FMU must pass.
mod every {
    fmu_test_kit::every_check!(crate::models::Oscillator);
}
