//! The C types of FMI 2.0, as in `fmi2TypesPlatform.h` and `fmi2FunctionTypes.h`, written by hand.
//!
//! Enumerations that a caller passes in arrive as plain integers ([`fmi2Type`], [`fmi2StatusKind`]),
//! because a C caller can pass any value, and so does a [`Status`].
#![allow(non_camel_case_types)]

use crate::c_types::{c_char, c_int, c_uint, c_void};
pub use crate::status::Status;

/// What a call answers: a [`Status`] as C has it, an int, because a foreign library may answer any.
pub type fmi2Status = c_int;
/// An instance, as the importer holds it.
pub type fmi2Component = *mut c_void;
/// The importer's own data, handed back to its callbacks.
pub type fmi2ComponentEnvironment = *mut c_void;
/// A saved state of an instance, as the importer holds it.
pub type fmi2FMUstate = *mut c_void;
/// The handle of a variable.
pub type fmi2ValueReference = c_uint;
/// A floating-point value.
pub type fmi2Real = f64;
/// A signed integer value.
pub type fmi2Integer = c_int;
/// A truth value: 0 or 1.
pub type fmi2Boolean = c_int;
/// One character.
pub type fmi2Char = c_char;
/// A zero-terminated UTF-8 string.
pub type fmi2String = *const fmi2Char;
/// One byte of a serialized state.
pub type fmi2Byte = c_char;
/// [`fmi2True`] as C sees it.
#[allow(non_upper_case_globals)]
pub const fmi2True: fmi2Boolean = 1;
/// [`fmi2False`] as C sees it.
#[allow(non_upper_case_globals)]
pub const fmi2False: fmi2Boolean = 0;

/// `fmi2Type` as it arrives: 0 is Model Exchange, 1 is Co-Simulation.
pub type fmi2Type = c_int;
/// `fmi2StatusKind` as it arrives: 0 to 3, see [`StatusKind`].
pub type fmi2StatusKind = c_int;

/// What the `fmi2Get...Status` functions can be asked for (section 4.2.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatusKind {
    /// The result of an asynchronous step.
    DoStepStatus,
    /// A text about a pending step.
    PendingStatus,
    /// The end of the last step that succeeded.
    LastSuccessfulTime,
    /// Whether the slave wants to end the simulation.
    Terminated,
}

impl StatusKind {
    /// The kind behind a C value, if there is one.
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

/// The importer's log function. It is variadic like `printf`; this crate never passes arguments.
pub type fmi2CallbackLogger = unsafe extern "C" fn(
    environment: fmi2ComponentEnvironment,
    instance_name: fmi2String,
    status: fmi2Status,
    category: fmi2String,
    message: fmi2String,
    ...
);
/// The importer's `calloc`. Never called: instances live on Rust's heap
/// (`canNotUseMemoryManagementFunctions`).
pub type fmi2CallbackAllocateMemory = unsafe extern "C" fn(count: usize, size: usize) -> *mut c_void;
/// The importer's `free`. Never called.
pub type fmi2CallbackFreeMemory = unsafe extern "C" fn(memory: *mut c_void);
/// Tells the importer that an asynchronous step has ended. Never called: no step is asynchronous.
pub type fmi2StepFinished = unsafe extern "C" fn(environment: fmi2ComponentEnvironment, status: fmi2Status);

/// The importer's callbacks; each may be NULL.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct fmi2CallbackFunctions {
    /// Receives log messages.
    pub logger: Option<fmi2CallbackLogger>,
    /// Unused.
    pub allocate_memory: Option<fmi2CallbackAllocateMemory>,
    /// Unused.
    pub free_memory: Option<fmi2CallbackFreeMemory>,
    /// Unused.
    pub step_finished: Option<fmi2StepFinished>,
    /// Handed back to the logger.
    pub component_environment: fmi2ComponentEnvironment,
}

/// What an event did (section 3.2.2).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct fmi2EventInfo {
    /// The event iteration has to go on.
    pub new_discrete_states_needed: fmi2Boolean,
    /// The model wants to end the simulation.
    pub terminate_simulation: fmi2Boolean,
    /// The nominal values of the states have changed.
    pub nominals_of_continuous_states_changed: fmi2Boolean,
    /// The states have changed.
    pub values_of_continuous_states_changed: fmi2Boolean,
    /// `next_event_time` holds a time event.
    pub next_event_time_defined: fmi2Boolean,
    /// The next time event.
    pub next_event_time: fmi2Real,
}
