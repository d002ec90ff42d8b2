//! FMI 3.0: what its C functions do, in the same form as [`fmi2`](crate::fmi2).
//!
//! A model needs nothing for it: value references are those of FMI 2.0, the instantiation token is the guid. What
//! FMI 3.0 has more is refused, with the reason: arrays, clocks, structural parameters, intermediate update and
//! Scheduled Execution.
//!
//! Every model has a time, as the standard asks for: the independent variable of the table, or one behind all others
//! ([`independent`]). Behind it there is a local variable for each event indicator ([`indicator`]).
//!
//! # Safety
//!
//! The contract with the importer is that of [`fmi2`](crate::fmi2), with an instance in place of a component. Bytes of
//! an `fmi3Binary` are NULL or as many as their size says. Truth values are bytes here: C callers may pass any.
#![allow(non_snake_case)]
#![allow(clippy::missing_safety_doc, reason = "the contract above is that of every function")]
#![allow(clippy::too_many_arguments, reason = "as many as the standard has")]

mod absent;
mod co_simulation;
mod common;
mod instances;
mod model_exchange;
mod values;

pub use fmi_abi::fmi3::{ALLOWED, Function, Functions, types};
pub use instances::{
    fmi3FreeInstance, fmi3GetVersion, fmi3InstantiateCoSimulation, fmi3InstantiateModelExchange,
    fmi3InstantiateScheduledExecution,
};

use crate::table::Variables;
use crate::variable::Variable;
use types::*;

/// The independent variable with its value reference: that of the table, or `time`, with the number of variables in
/// the table for a value reference.
pub fn independent<M: Variables>() -> (u32, &'static Variable<M>) {
    crate::instance::independent::<M>()
}

/// The value reference of an event indicator, counted from 0: behind the table and a place for the time.
pub fn indicator<M: Variables>(number: usize) -> u32 {
    (M::TABLE.len() + 1 + number) as u32
}

fmi_abi::fmi3_functions!(crate::symbols::c_functions);

/// What the functions do, each under its C name.
mod bodies {
    pub(super) use super::absent::*;
    pub(super) use super::co_simulation::*;
    pub(super) use super::common::*;
    pub(super) use super::model_exchange::*;
    pub(super) use super::values::*;
}
