//! The C types of FMI 3.0, as in `fmi3PlatformTypes.h` and `fmi3FunctionTypes.h`, written by hand.
#![allow(non_camel_case_types)]

use crate::c_types::{c_char, c_int, c_void};
pub use crate::status::Status;

/// What a call answers: a [`Status`] as C has it, an int, because a foreign library may answer any.
pub type fmi3Status = c_int;
/// An instance, as the importer holds it.
pub type fmi3Instance = *mut c_void;
/// The importer's own data, handed back to its callbacks.
pub type fmi3InstanceEnvironment = *mut c_void;
/// A saved state of an instance, as the importer holds it.
pub type fmi3FMUState = *mut c_void;
/// The handle of a variable.
pub type fmi3ValueReference = u32;
/// A floating-point value of 32 bits.
pub type fmi3Float32 = f32;
/// A floating-point value of 64 bits.
pub type fmi3Float64 = f64;
/// A whole number.
pub type fmi3Int8 = i8;
/// A whole number.
pub type fmi3UInt8 = u8;
/// A whole number.
pub type fmi3Int16 = i16;
/// A whole number.
pub type fmi3UInt16 = u16;
/// A whole number.
pub type fmi3Int32 = i32;
/// A whole number.
pub type fmi3UInt32 = u32;
/// A whole number.
pub type fmi3Int64 = i64;
/// A whole number.
pub type fmi3UInt64 = u64;
/// A truth value: `bool` in C; a byte here, because a C caller can pass any.
pub type fmi3Boolean = u8;
/// One character.
pub type fmi3Char = c_char;
/// A zero-terminated UTF-8 string.
pub type fmi3String = *const fmi3Char;
/// One byte.
pub type fmi3Byte = u8;
/// Bytes whose number is passed beside them.
pub type fmi3Binary = *const fmi3Byte;
/// Whether a clock ticks: `bool` in C.
pub type fmi3Clock = u8;
/// [`fmi3True`] as C sees it.
#[allow(non_upper_case_globals)]
pub const fmi3True: fmi3Boolean = 1;
/// [`fmi3False`] as C sees it.
#[allow(non_upper_case_globals)]
pub const fmi3False: fmi3Boolean = 0;

/// `fmi3DependencyKind`.
pub type fmi3DependencyKind = c_int;
/// `fmi3Dependent`: nothing is known of how it depends.
#[allow(non_upper_case_globals)]
pub const fmi3Dependent: fmi3DependencyKind = 5;
/// `fmi3IntervalQualifier`.
pub type fmi3IntervalQualifier = c_int;

/// The importer's log function.
pub type fmi3LogMessageCallback = unsafe extern "C" fn(
    environment: fmi3InstanceEnvironment,
    status: fmi3Status,
    category: fmi3String,
    message: fmi3String,
);
/// Never called: there are no clocks.
pub type fmi3ClockUpdateCallback = unsafe extern "C" fn(environment: fmi3InstanceEnvironment);
/// Never called: nothing is exchanged within a step.
pub type fmi3IntermediateUpdateCallback = unsafe extern "C" fn(
    environment: fmi3InstanceEnvironment,
    time: fmi3Float64,
    set_requested: fmi3Boolean,
    get_allowed: fmi3Boolean,
    step_finished: fmi3Boolean,
    can_return_early: fmi3Boolean,
    early_return_requested: *mut fmi3Boolean,
    early_return_time: *mut fmi3Float64,
);
/// Never called: there is no Scheduled Execution.
pub type fmi3LockPreemptionCallback = unsafe extern "C" fn();
/// Never called: there is no Scheduled Execution.
pub type fmi3UnlockPreemptionCallback = unsafe extern "C" fn();
