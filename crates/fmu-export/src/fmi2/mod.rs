//! Implementation of the C functions of FMI 2.0. Only this module, [`fmi3`](crate::fmi3) and `boundary` receive
//! pointers from the importer.
//!
//! Each C function exists once, generic over the model and under its C name. `boundary` carries out all calls on an
//! instance in the same way: it finds the instance, checks the table of allowed calls, runs the function's body,
//! converts an error or a panic into a status, and delivers the log messages. So no panic reaches the importer.
//!
//! # Safety
//!
//! All functions share one contract with the importer, which is the contract of the FMI standard:
//! * A component is NULL, or `fmi2Instantiate` of this library has returned it for the same model, and it has not
//!   been freed. Two threads do not use it at the same time, although most of such calls are recognized and rejected.
//!   (A call from within the log callback is safe, and is rejected.)
//! * `fmi2GetFMUstate`, `fmi2DeSerializeFMUstate` and `fmi2FreeFMUstate` get a pointer to an initialized handle,
//!   which is NULL before its first use (section 2.1.8 of FMI 2.0). Any value of the handle is safe, because a handle
//!   is not dereferenced, and is rejected unless it belongs to a state of this instance.
//! * A pointer with a length is NULL or points to that many values; a pointer to one value is NULL or points to one.
//!   Strings are NUL-terminated. An array to which a function writes does not overlap other arrays; its previous
//!   content may be uninitialized.
//! * The callbacks work until the instance is freed.
#![allow(non_snake_case)]
#![allow(clippy::missing_safety_doc, reason = "every function has the contract above")]

mod co_simulation;
mod common;
mod instances;

pub use fmi_abi::fmi2::{ALLOWED, Function, Functions, types};
pub use instances::{fmi2FreeInstance, fmi2GetTypesPlatform, fmi2GetVersion, fmi2Instantiate};

#[cfg(target_family = "wasm")]
pub use crate::boundary::webassembly::{add_file, argument_buffer, broken};

use types::*;

fmi_abi::fmi2_functions!(crate::boundary::short::c_functions);

/// Bodies of the functions, each under its C name.
mod bodies {
    pub(super) use super::co_simulation::*;
    pub(super) use super::common::*;
    pub(super) use crate::boundary::life_cycle::{
        enter_event_mode as fmi2EnterEventMode, exit_initialization_mode as fmi2ExitInitializationMode,
        reset as fmi2Reset, set_debug_logging as fmi2SetDebugLogging, terminate as fmi2Terminate,
    };
    pub(super) use crate::boundary::model_exchange::{
        completed_integrator_step as fmi2CompletedIntegratorStep,
        enter_continuous_time_mode as fmi2EnterContinuousTimeMode,
        get_continuous_states as fmi2GetContinuousStates, get_derivatives as fmi2GetDerivatives,
        get_event_indicators as fmi2GetEventIndicators, get_nominals as fmi2GetNominalsOfContinuousStates,
        set_continuous_states as fmi2SetContinuousStates, set_time as fmi2SetTime,
    };
    pub(super) use crate::boundary::states::{
        deserialize as fmi2DeSerializeFMUstate, free_state as fmi2FreeFMUstate, get_state as fmi2GetFMUstate,
        serialize as fmi2SerializeFMUstate, serialized_size as fmi2SerializedFMUstateSize,
        set_state as fmi2SetFMUstate,
    };
}
