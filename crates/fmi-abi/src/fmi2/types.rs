//! The C types of FMI 2.0, as in `fmi2TypesPlatform.h` and `fmi2FunctionTypes.h`, written by hand.
//!
//! Enumerations that a caller passes are plain integers ([`fmi2Type`], [`fmi2StatusKind`]), because a C
//! caller can pass any value. A [`Status`] is a plain integer too.
#![allow(non_camel_case_types)]

use crate::c_types::{c_char, c_int, c_uint, c_void};
pub use crate::status::Status;

/// Status of a call: a [`Status`] as C int, because a third-party library may return any value.
pub type fmi2Status = c_int;
/// Handle of an instance.
pub type fmi2Component = *mut c_void;
/// Data of the importer, passed to its callbacks.
pub type fmi2ComponentEnvironment = *mut c_void;
/// Handle of a saved state.
pub type fmi2FMUstate = *mut c_void;
/// Value reference of a variable.
pub type fmi2ValueReference = c_uint;
/// A floating-point value.
pub type fmi2Real = f64;
/// A signed integer value.
pub type fmi2Integer = c_int;
/// A Boolean: 0 or 1.
pub type fmi2Boolean = c_int;
/// One character.
pub type fmi2Char = c_char;
/// A NUL-terminated UTF-8 string.
pub type fmi2String = *const fmi2Char;
/// One byte of a serialized state.
pub type fmi2Byte = c_char;
/// `fmi2True`, the value of true.
#[allow(non_upper_case_globals)]
pub const fmi2True: fmi2Boolean = 1;
/// `fmi2False`, the value of false.
#[allow(non_upper_case_globals)]
pub const fmi2False: fmi2Boolean = 0;

/// `fmi2Type` as a number: 0 is Model Exchange, 1 is Co-Simulation.
pub type fmi2Type = c_int;
/// `fmi2StatusKind` as a number: 0 to 3, see [`StatusKind`].
pub type fmi2StatusKind = c_int;

/// Information that the `fmi2Get...Status` functions return (section 4.2.3 of FMI 2.0).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatusKind {
    /// The result of an asynchronous step.
    DoStepStatus,
    /// A message about a pending step.
    PendingStatus,
    /// The time at the end of the last successful step.
    LastSuccessfulTime,
    /// Whether the FMU requests the end of the simulation.
    Terminated,
}

impl StatusKind {
    /// Returns the kind for a C value, if it is valid.
    pub const fn from_c(value: fmi2StatusKind) -> Option<Self> {
        match value {
            0 => Some(Self::DoStepStatus),
            1 => Some(Self::PendingStatus),
            2 => Some(Self::LastSuccessfulTime),
            3 => Some(Self::Terminated),
            _ => None,
        }
    }
}

/// The importer's log function. It is variadic like `printf`; fmu-export never passes further arguments.
pub type fmi2CallbackLogger = unsafe extern "C" fn(
    environment: fmi2ComponentEnvironment,
    instance_name: fmi2String,
    status: fmi2Status,
    category: fmi2String,
    message: fmi2String,
    ...
);
/// The importer's `calloc`. fmu-export never calls it, because instances are on Rust's heap
/// (`canNotUseMemoryManagementFunctions`).
pub type fmi2CallbackAllocateMemory = unsafe extern "C" fn(count: usize, size: usize) -> *mut c_void;
/// The importer's `free`. fmu-export never calls it.
pub type fmi2CallbackFreeMemory = unsafe extern "C" fn(memory: *mut c_void);
/// Callback for the end of an asynchronous step. fmu-export never calls it, because its steps are synchronous.
pub type fmi2StepFinished = unsafe extern "C" fn(environment: fmi2ComponentEnvironment, status: fmi2Status);

/// The importer's callbacks; each may be NULL.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct fmi2CallbackFunctions {
    /// Receives log messages.
    pub logger: Option<fmi2CallbackLogger>,
    /// Unused by fmu-export.
    pub allocate_memory: Option<fmi2CallbackAllocateMemory>,
    /// Unused by fmu-export.
    pub free_memory: Option<fmi2CallbackFreeMemory>,
    /// Unused by fmu-export.
    pub step_finished: Option<fmi2StepFinished>,
    /// Passed to the logger.
    pub component_environment: fmi2ComponentEnvironment,
}

/// Result of an event (section 3.2.2 of FMI 2.0).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct fmi2EventInfo {
    /// Whether another event iteration is needed.
    pub new_discrete_states_needed: fmi2Boolean,
    /// Whether the model requests the end of the simulation.
    pub terminate_simulation: fmi2Boolean,
    /// Whether the nominal values of the states have changed.
    pub nominals_of_continuous_states_changed: fmi2Boolean,
    /// Whether the states have changed.
    pub values_of_continuous_states_changed: fmi2Boolean,
    /// Whether `next_event_time` is valid.
    pub next_event_time_defined: fmi2Boolean,
    /// Time of the next time event.
    pub next_event_time: fmi2Real,
}
