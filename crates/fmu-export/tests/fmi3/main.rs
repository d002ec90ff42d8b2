//! Toy models as an importer of FMI 3.0 sees them.
#![allow(missing_docs)]

#[path = "../toys/mod.rs"]
mod toys;

mod call_table;
mod derivatives;
mod events;
mod headers;
mod hostile;
mod same;
mod start_values;
mod states;
mod values;
