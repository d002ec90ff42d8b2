//! The C types of FMI 3.0, as in `fmi3PlatformTypes.h` and `fmi3FunctionTypes.h`, written by hand.
#![allow(non_camel_case_types)]

use crate::c_types::{c_char, c_int, c_void};
pub use crate::status::Status;

/// Status of a call: a [`Status`] as C int, because a third-party library may return any value.
pub type fmi3Status = c_int;
/// Handle of an instance.
pub type fmi3Instance = *mut c_void;
/// Data of the importer, passed to its callbacks.
pub type fmi3InstanceEnvironment = *mut c_void;
/// Handle of a saved state.
pub type fmi3FMUState = *mut c_void;
/// Value reference of a variable.
pub type fmi3ValueReference = u32;
/// A 32-bit floating-point value.
pub type fmi3Float32 = f32;
/// A 64-bit floating-point value.
pub type fmi3Float64 = f64;
/// A signed 8-bit integer.
pub type fmi3Int8 = i8;
/// An unsigned 8-bit integer.
pub type fmi3UInt8 = u8;
/// A signed 16-bit integer.
pub type fmi3Int16 = i16;
/// An unsigned 16-bit integer.
pub type fmi3UInt16 = u16;
/// A signed 32-bit integer.
pub type fmi3Int32 = i32;
/// An unsigned 32-bit integer.
pub type fmi3UInt32 = u32;
/// A signed 64-bit integer.
pub type fmi3Int64 = i64;
/// An unsigned 64-bit integer.
pub type fmi3UInt64 = u64;
/// A Boolean: `bool` in C. The type is a byte, because a C caller can pass values other than 0 and 1.
pub type fmi3Boolean = u8;
/// One character.
pub type fmi3Char = c_char;
/// A NUL-terminated UTF-8 string.
pub type fmi3String = *const fmi3Char;
/// One byte.
pub type fmi3Byte = u8;
/// Bytes; their number is a separate argument.
pub type fmi3Binary = *const fmi3Byte;
/// Whether a clock ticks: `bool` in C.
pub type fmi3Clock = u8;
/// `fmi3True`, the value of true.
#[allow(non_upper_case_globals)]
pub const fmi3True: fmi3Boolean = 1;
/// `fmi3False`, the value of false.
#[allow(non_upper_case_globals)]
pub const fmi3False: fmi3Boolean = 0;

/// Kind of a dependency: the C enumeration `fmi3DependencyKind` as an integer.
pub type fmi3DependencyKind = c_int;
/// `fmi3Dependent`: a dependency of any kind.
#[allow(non_upper_case_globals)]
pub const fmi3Dependent: fmi3DependencyKind = 5;
/// State of a clock's interval: the C enumeration `fmi3IntervalQualifier` as an integer.
pub type fmi3IntervalQualifier = c_int;

/// The importer's log function.
pub type fmi3LogMessageCallback = unsafe extern "C" fn(
    environment: fmi3InstanceEnvironment,
    status: fmi3Status,
    category: fmi3String,
    message: fmi3String,
);
/// Callback for ticks of clocks. fmu-export never calls it, because it does not support clocks.
pub type fmi3ClockUpdateCallback = unsafe extern "C" fn(environment: fmi3InstanceEnvironment);
/// Callback within a step. fmu-export never calls it, because it does not support intermediate update.
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
/// Callback of Scheduled Execution, which fmu-export does not support.
pub type fmi3LockPreemptionCallback = unsafe extern "C" fn();
/// Callback of Scheduled Execution, which fmu-export does not support.
pub type fmi3UnlockPreemptionCallback = unsafe extern "C" fn();
