//! Log callbacks that are passed to FMUs. They pass each message on to the receiver of the program.

use crate::Standard;
use crate::c_types::{c_char, c_int, c_void};
use crate::fmi2::types::*;
use crate::fmi3::types::*;
use std::ffi::CStr;
use std::ptr::null;

/// A log message as the FMU passes it. [`string`] reads its strings.
#[derive(Debug)]
pub struct LogMessage {
    /// FMI version of the callback.
    pub standard: Standard,
    /// Environment of the instance. It may be wrong: some FMUs pass their own pointer, NULL, or the environment of another instance.
    pub environment: *mut c_void,
    /// Name of the instance; NULL in FMI 3.0, which does not pass it.
    pub instance_name: *const c_char,
    /// Status of the message.
    pub status: c_int,
    /// Log category.
    pub category: *const c_char,
    /// Text of the message. In FMI 2.0 it is a `printf` format for the values (section 2.1.5).
    pub text: *const c_char,
    /// Values for the format; `None` in FMI 3.0, and on platforms where they cannot be read.
    pub values: Option<LogValues>,
}

/// Values that may follow a format. If the FMU passes fewer values, the others are arbitrary.
#[derive(Clone, Copy, Debug)]
pub struct LogValues {
    /// Integers and pointers.
    pub words: [usize; 8],
    /// Floating-point numbers.
    pub numbers: [f64; 8],
}

/// Receives the log messages of the instances that were created with [`callbacks`] or [`log_callback`] of this type.
pub trait LogReceiver {
    /// Receives a message, while the FMU logs it and on its thread. It must not panic.
    ///
    /// # Safety
    /// Each string of the message is NULL or ends with NUL.
    unsafe fn receive(message: LogMessage);
}

/// Returns a string that an FMU passed; `None` for NULL.
///
/// # Safety
/// `pointer` is NULL, or points to a string that ends with NUL and lives as long as the returned value is used.
pub unsafe fn string<'a>(pointer: *const c_char) -> Option<&'a CStr> {
    // SAFETY: the caller guarantees a string if the pointer is not NULL.
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) })
}

/// Returns the callbacks of FMI 2.0 (section 2.1.5 of FMI 2.0.5). The returned value must live as long as the
/// instance. The memory functions call `calloc` and `free` of C. They must be present, because only an FMU with
/// `canNotUseMemoryManagementFunctions` ignores them.
pub fn callbacks<R: LogReceiver>(environment: *mut c_void) -> fmi2CallbackFunctions {
    let logger = log_of_fmi2::<R> as *const ();
    fmi2CallbackFunctions {
        // SAFETY: the documentation of `log_of_fmi2` explains why both types have compatible calls.
        logger: Some(unsafe { std::mem::transmute::<*const (), fmi2CallbackLogger>(logger) }),
        allocate_memory: Some(allocate),
        free_memory: Some(free),
        step_finished: None,
        component_environment: environment,
    }
}

/// Returns the log callback of FMI 3.0 (section 2.3.1 of FMI 3.0).
pub fn log_callback<R: LogReceiver>() -> fmi3LogMessageCallback {
    log_of_fmi3::<R>
}

unsafe extern "C" fn allocate(count: usize, size: usize) -> *mut c_void {
    // SAFETY: any arguments are allowed; the FMU frees the memory with `free`.
    unsafe { libc::calloc(count, size) }
}

unsafe extern "C" fn free(memory: *mut c_void) {
    // SAFETY: section 2.1.5 of FMI 2.0 requires NULL, or memory of `allocate` that is freed once.
    unsafe { libc::free(memory) }
}

/// Logger of FMI 2.0. Stable Rust cannot define variadic functions, so this one has a fixed number of arguments: integers and
/// pointers, then floating-point numbers, which are passed in separate registers. On Linux, and on macOS with Intel processors,
/// variadic functions receive their arguments in these registers and then on the stack. If the caller passes fewer arguments, the
/// others have arbitrary values; reading them is harmless there, and a correct format does not use them.
#[cfg(all(any(all(unix, target_arch = "x86_64"), all(target_os = "linux", target_arch = "aarch64")), not(miri)))]
#[allow(clippy::too_many_arguments, reason = "the values of the format")]
#[rustfmt::skip]
unsafe extern "C" fn log_of_fmi2<R: LogReceiver>(
    environment: fmi2ComponentEnvironment,
    instance_name: fmi2String,
    status: fmi2Status,
    category: fmi2String,
    text: fmi2String,
    a: usize, b: usize, c: usize, d: usize, e: usize, f: usize, g: usize, h: usize,
    r: f64, s: f64, t: f64, u: f64, v: f64, w: f64, x: f64, y: f64,
) {
    let standard = Standard::Fmi2;
    let values = Some(LogValues { words: [a, b, c, d, e, f, g, h], numbers: [r, s, t, u, v, w, x, y] });
    // SAFETY: section 2.1.5 of FMI 2.0 requires NULL or NUL-terminated strings.
    unsafe { R::receive(LogMessage { environment, instance_name, status, category, text, values, standard }) }
}

/// Logger of FMI 2.0 for all other platforms, where the values cannot be read. The arguments before the `...` are passed in the same
/// way as to a function without `...`. Miri checks the calling convention, so the function is variadic there.
#[cfg(any(
    miri,
    not(any(all(unix, target_arch = "x86_64"), all(target_os = "linux", target_arch = "aarch64")))
))]
unsafe extern "C" fn log_of_fmi2<R: LogReceiver>(
    environment: fmi2ComponentEnvironment,
    instance_name: fmi2String,
    status: fmi2Status,
    category: fmi2String,
    text: fmi2String,
    #[cfg(miri)] _: ...
) {
    let (standard, values) = (Standard::Fmi2, None);
    // SAFETY: section 2.1.5 of FMI 2.0 requires NULL or NUL-terminated strings.
    unsafe { R::receive(LogMessage { environment, instance_name, status, category, text, values, standard }) }
}

unsafe extern "C" fn log_of_fmi3<R: LogReceiver>(
    environment: fmi3InstanceEnvironment,
    status: fmi3Status,
    category: fmi3String,
    text: fmi3String,
) {
    let (standard, instance_name, values) = (Standard::Fmi3, null(), None);
    // SAFETY: section 2.3.1 of FMI 3.0 requires NULL or NUL-terminated strings.
    unsafe { R::receive(LogMessage { environment, instance_name, status, category, text, values, standard }) }
}
