//! FMI 3.0: what its C functions do, in the same form as [`fmi2`](crate::fmi2).
//!
//! A model needs nothing for it: the variables are those of FMI 2.0, the instantiation token is the guid. Arrays are
//! variables, where FMI 2.0 has one for each element. What FMI 3.0 has more is refused, with the reason: clocks,
//! structural parameters, intermediate update and Scheduled Execution.
//!
//! Every model has a time, as the standard asks for: the independent variable of the table, or one behind all others
//! ([`independent`]). Behind it there is a local variable for each event indicator ([`indicator`]).
//!
//! [Value references](reference()) count from 1 in the order of the variables, where an array counts as many times as it
//! has elements: OMSimulator 3.0.0 takes those of
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
pub(crate) struct FromOne(fmi3ValueReference);

impl Reference for FromOne {
    const ARRAYS: bool = true;
    const REFERENCES: &str = "valueReferences";
    const VALUES: &str = "values";

    #[inline]
    fn cast(array: *const u32) -> *const Self {
        array.cast()
    }

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
    pub(super) use crate::boundary::life_cycle::{
        enter_event_mode as fmi3EnterEventMode, exit_initialization_mode as fmi3ExitInitializationMode,
        reset as fmi3Reset, set_debug_logging as fmi3SetDebugLogging, terminate as fmi3Terminate,
    };
    pub(super) use crate::boundary::model_exchange::{
        completed_integrator_step as fmi3CompletedIntegratorStep,
        enter_continuous_time_mode as fmi3EnterContinuousTimeMode,
        get_continuous_states as fmi3GetContinuousStates,
        get_derivatives as fmi3GetContinuousStateDerivatives, get_event_indicators as fmi3GetEventIndicators,
        get_nominals as fmi3GetNominalsOfContinuousStates, set_continuous_states as fmi3SetContinuousStates,
        set_time as fmi3SetTime,
    };
    pub(super) use crate::boundary::states::{
        deserialize as fmi3DeserializeFMUState, free_state as fmi3FreeFMUState, get_state as fmi3GetFMUState,
        serialize as fmi3SerializeFMUState, serialized_size as fmi3SerializedFMUStateSize,
        set_state as fmi3SetFMUState,
    };
}
