//! Toy models as an importer sees them: the C functions of FMI 2.0, called as the standard and as careless masters call
//! them.
#![allow(missing_docs)]

#[path = "../toys/mod.rs"]
mod toys;

/// Runs a function for every toy.
macro_rules! for_every_toy {
    ($function:ident($($argument:expr),*)) => {{
        $function::<crate::toys::Oscillator>($($argument),*);
        $function::<crate::toys::Ball>($($argument),*);
        $function::<crate::toys::Counter>($($argument),*);
        $function::<crate::toys::Talker>($($argument),*);
        $function::<crate::toys::Sum>($($argument),*);
        $function::<crate::toys::Fuse>($($argument),*);
        $function::<crate::toys::Lazy>($($argument),*);
        $function::<crate::toys::Balance>($($argument),*);
    }};
}

mod calculated;
mod call_table;
mod derivatives;
mod early_steps;
mod events;
mod experiment;
mod importers;
mod less;
mod logging;
mod modes;
mod oscillation;
mod random;
mod refusals;
mod saved_states;
mod settable;
mod start_values;
mod tolerances;
mod variables;
