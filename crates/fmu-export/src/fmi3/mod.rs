//! FMI 3.0: what its C functions do, in the same form as [`fmi2`](crate::fmi2).
//!
//! A model needs nothing for it: the variables are those of FMI 2.0, the instantiation token is the guid. What FMI 3.0
//! has more is refused, with the reason: arrays, clocks, structural parameters, intermediate update and Scheduled
//! Execution.
//!
//! Every model has a time, as the standard asks for: the independent variable of the table, or one behind all others
//! ([`independent`]). Behind it there is a local variable for each event indicator ([`indicator`]).
//!
//! [Value references](reference()) count from 1 in the order of the variables: OMSimulator 3.0.0 takes those of
//! dependencies for places in the list, which count from 1 in FMI 2.0, and both readings lead to the same variable.
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

use crate::instance::Reference;
use crate::table::Variables;
use crate::variable::Variable;
use fmi_abi::Standard;
use types::*;

/// The value reference of the variable at this place of the table, or behind it.
pub const fn reference(place: u32) -> fmi3ValueReference {
    Standard::Fmi3.reference(place)
}

/// A [value reference](reference()) as an importer passes it.
#[derive(Clone, Copy)]
#[repr(transparent)]
struct FromOne(fmi3ValueReference);

impl Reference for FromOne {
    #[inline]
    fn place(self) -> u32 {
        self.0.wrapping_sub(reference(0))
    }
}

/// The independent variable with its place: that in the table, or that of `time`, the first behind it.
pub fn independent<M: Variables>() -> (u32, &'static Variable<M>) {
    crate::instance::independent::<M>()
}

/// The place of an event indicator, counted from 0: behind the table and the time.
pub fn indicator<M: Variables>(number: usize) -> u32 {
    crate::instance::first_indicator::<M>() + number as u32
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
