//! Implementation of the C functions of FMI 3.0. The structure is the same as in [`fmi2`](crate::fmi2).
//!
//! A model needs nothing special for FMI 3.0. It has the same variables as in FMI 2.0, except that an array is one
//! variable, whereas FMI 2.0 has one variable for each element. The instantiation token is the guid. Clocks, structural
//! parameters, intermediate update and Scheduled Execution are not supported. Their functions return an error with the
//! reason, except the functions of Configuration Mode before the initialization.
//!
//! Every model has an independent variable, the time, as FMI 3.0 requires. If the table does not contain it, it
//! follows the table as an additional variable ([`independent`]). Then follows a local variable for each event
//! indicator ([`indicator`]).
//!
//! [Value references](reference()) count from 1 in the order of the variables, and an array takes as many as it has
//! elements. The references count from 1 because OMSimulator 3.0.0 takes the value references of dependencies for
//! indices in the list of variables, which count from 1 in FMI 2.0. Both interpretations then select the same variable,
//! unless an array precedes it.
//!
//! # Safety
//!
//! The contract with the importer is the contract of [`fmi2`](crate::fmi2), with an instance in place of a component.
//! An `fmi3Binary` is NULL or points to as many bytes as the size that is passed with it. Booleans are bytes here, so
//! that C callers may pass any value.
#![allow(non_snake_case)]
#![allow(clippy::missing_safety_doc, reason = "every function has the contract above")]
#![allow(clippy::too_many_arguments, reason = "the FMI standard defines the arguments")]

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

/// Returns the value reference of the variable at this index, which is in the table or after it.
pub const fn reference(index: u32) -> fmi3ValueReference {
    Standard::Fmi3.reference(index)
}

/// Returns the index of the independent variable, and the variable: in the table, or the variable `time`, which then
/// follows the table.
pub fn independent<M: Variables>() -> (u32, &'static Variable<M>) {
    crate::instance::independent::<M>()
}

/// Returns the index of the variable of an event indicator. `number` is the number of the indicator, counted from 0.
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
