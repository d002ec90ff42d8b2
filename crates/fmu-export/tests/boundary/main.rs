//! Tests of the C functions of FMI 2.0 with test models, called as in the standard and by fault-injecting
//! importers.
#![allow(missing_docs)]

#[path = "../models/mod.rs"]
mod models;

use fmu_export::{Exported, Interface};

/// Calls a function for every test model.
macro_rules! for_every_model {
    ($function:ident($($argument:expr),*)) => {{
        $function::<crate::models::Oscillator>($($argument),*);
        $function::<crate::models::Ball>($($argument),*);
        $function::<crate::models::Counter>($($argument),*);
        $function::<crate::models::Talker>($($argument),*);
        $function::<crate::models::Sum>($($argument),*);
        $function::<crate::models::Fuse>($($argument),*);
        $function::<crate::models::Motor>($($argument),*);
        $function::<crate::models::Lazy>($($argument),*);
        $function::<crate::models::Balance>($($argument),*);
        $function::<crate::models::Meter>($($argument),*);
    }};
}

mod calculated;
mod call_table;
mod derivatives;
mod early_steps;
mod events;
mod experiment;
mod fmi3;
mod less;
mod logging;
mod oscillation;
mod places;
mod refusals;
mod saved_states;
mod settable;
mod simulation;
mod start_values;
mod tolerances;
mod variables;

const INTERFACES: [Interface; 2] = [Interface::CoSimulation, Interface::ModelExchange];

/// Returns whether the model supports an interface type.
fn offers<M: Exported>(interface: Interface) -> bool {
    match interface {
        Interface::CoSimulation => M::CO_SIMULATION.is_some(),
        Interface::ModelExchange => M::MODEL_EXCHANGE.is_some(),
    }
}

/// Tests for every FMU with all capabilities.
mod every {
    fmu_test_kit::every_check!(crate::models::Oscillator);
}
