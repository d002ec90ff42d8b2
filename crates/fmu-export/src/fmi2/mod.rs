//! FMI 2.0: what its C functions do. With [`fmi3`](crate::fmi3) and `boundary` the only place with pointers and `unsafe`.
//!
//! Each C function exists once, generic over the model and under its C name. Those that work on an instance are all
//! called in the same way (`boundary`): find the instance, ask the table of allowed calls, run the function's body,
//! turn a refusal or a panic into a status, deliver what is to be logged. No panic leaves this module.
//!
//! # Safety
//!
//! All functions share one contract with the importer, the standard's:
//! * a component is NULL or comes from `fmi2Instantiate` of this library, with the same model, and has not been freed;
//!   it is not used by two threads at once (the log callback may try: it is refused);
//! * the handle that `fmi2GetFMUstate`, `fmi2DeSerializeFMUstate` and `fmi2FreeFMUstate` are given a pointer to is
//!   initialized: NULL before it is used first (section 2.1.8). What it points to does not matter: a handle that is none
//!   of a state of this instance is refused, not followed;
//! * a pointer with a length is NULL or points to that many values; a pointer to one value is NULL or points to one;
//!   strings end with a zero byte; arrays that are written do not overlap others; they may hold anything before, memory
//!   that was never written as well;
//! * the callbacks work until the instance is freed.
#![allow(non_snake_case)]
#![allow(clippy::missing_safety_doc, reason = "the contract above is that of every function")]

mod co_simulation;
mod common;
mod instances;

pub use fmi_abi::fmi2::{ALLOWED, Function, Functions, types};
pub use instances::{fmi2FreeInstance, fmi2GetTypesPlatform, fmi2GetVersion, fmi2Instantiate};

#[cfg(target_family = "wasm")]
pub use crate::boundary::webassembly::{broken, room};

use types::*;

fmi_abi::fmi2_functions!(crate::symbols::c_functions);

/// What the functions do, each under its C name.
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
