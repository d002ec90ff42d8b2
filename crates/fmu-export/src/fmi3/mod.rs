//! Implementation of the C functions of FMI 3.0, with the structure of [`fmi2`](crate::fmi2).
//!
//! A model needs nothing special for FMI 3.0. It has the variables of FMI 2.0, and the instantiation token is
//! the guid. An array is one variable, whereas FMI 2.0 has one variable for each element. Clocks, structural
//! parameters, intermediate update and Scheduled Execution are not supported; their functions return an error
//! with the reason.
//!
//! Every model has a time, as the FMI standard requires: the independent variable of the table, or an
//! additional one after all variables ([`independent`]). After it there is a local variable for each event
//! indicator ([`indicator`]).
//!
//! [Value references](reference()) count from 1 in the order of the variables, and an array takes as many as
//! it has elements. OMSimulator 3.0.0 interprets value references of dependencies as indices of the list,
//! which count from 1 in FMI 2.0. With this numbering, both interpretations select the same variable.
//!
//! # Safety
//!
//! The contract with the importer is the contract of [`fmi2`](crate::fmi2), with an instance in place of a
//! component. The bytes of an `fmi3Binary` are NULL or have the length that their size gives. Booleans are
//! bytes here, so that C callers may pass any value.
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

use crate::table::Variables;
use crate::variable::Variable;
use fmi_abi::Standard;
use types::*;

/// Returns the value reference of the variable at this index of the table, or after the table.
pub const fn reference(index: u32) -> fmi3ValueReference {
    Standard::Fmi3.reference(index)
}

/// Returns the independent variable with its index: in the table, or of `time`, the first after the table.
pub fn independent<M: Variables>() -> (u32, &'static Variable<M>) {
    crate::instance::independent::<M>()
}

/// Returns the index of an event indicator, counted from 0: after the table and the time.
pub fn indicator<M: Variables>(number: usize) -> u32 {
    crate::instance::first_indicator::<M>() + number as u32
}

fmi_abi::fmi3_functions!(crate::boundary::short::c_functions);

/// Bodies of the functions, each under its C name.
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
