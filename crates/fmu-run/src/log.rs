//! Log callbacks for FMUs.

use crate::rejection::Message;
use fmi_abi::Status;
use fmi_abi::c_types::{c_char, c_int, c_void};
use fmi_abi::fmi2::types::*;
use fmi_abi::fmi3::types::*;
use std::ffi::CStr;
use std::sync::{Mutex, PoisonError};

/// Messages of the FMU; the address of the log is the instance environment.
#[derive(Debug, Default)]
pub(crate) struct Log {
    /// Messages since the last failed call.
    new: Mutex<Vec<Message>>,
    /// All messages, if the caller requests them.
    all: Option<Mutex<Vec<Message>>>,
}

impl Log {
    /// Creates a log that also keeps all messages.
    pub(crate) fn keeping() -> Self {
        Self { all: Some(Mutex::default()), ..Self::default() }
    }

    pub(crate) fn take(&self) -> Vec<Message> {
        std::mem::take(&mut self.new.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Returns all messages since the last call, if they are kept.
    pub(crate) fn take_all(&self) -> Vec<Message> {
        let all = self.all.as_ref().map(|all| all.lock().unwrap_or_else(PoisonError::into_inner));
        all.map(|mut all| std::mem::take(&mut *all)).unwrap_or_default()
    }

    /// Stores a message.
    ///
    /// # Safety
    /// The environment is NULL or a live `Log`; the strings are NULL or valid.
    unsafe fn remember(
        environment: *mut c_void,
        status: c_int,
        category: *const c_char,
        text: *const c_char,
    ) {
        let text_of = |pointer: *const c_char| match pointer.is_null() {
            true => String::new(),
            // SAFETY: the caller guarantees a string if the pointer is not NULL.
            false => unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned(),
        };
        let [category, text] = [category, text].map(text_of);
        // SAFETY: the caller guarantees NULL or a live `Log`.
        if let Some(log) = unsafe { environment.cast::<Self>().as_ref() } {
            let message = Message { status: Status::from_c(status), category, text };
            if let Some(all) = &log.all {
                all.lock().unwrap_or_else(PoisonError::into_inner).push(message.clone());
            }
            log.new.lock().unwrap_or_else(PoisonError::into_inner).push(message);
        }
    }
}

pub(crate) fn logger_of_fmi2() -> fmi2CallbackLogger {
    let plain: unsafe extern "C" fn(_, _, _, _, _) = log_of_fmi2;
    // SAFETY: the documentation of `log_of_fmi2` explains why both types have compatible calls.
    unsafe { std::mem::transmute::<_, fmi2CallbackLogger>(plain) }
}

/// The logger of FMI 2.0 without its `...`, which stable Rust cannot define. The function ignores variadic
/// arguments. On every platform of this project, variadic and plain calls pass named arguments in the same
/// way.
unsafe extern "C" fn log_of_fmi2(
    environment: fmi2ComponentEnvironment,
    _instance_name: fmi2String,
    status: fmi2Status,
    category: fmi2String,
    message: fmi2String,
) {
    // SAFETY: section 2.1.5 requires NULL or NUL-terminated strings. The environment is the log that was
    // passed to the FMU; it lives as long as the instance.
    unsafe { Log::remember(environment, status, category, message) }
}

pub(crate) unsafe extern "C" fn log_of_fmi3(
    environment: fmi3InstanceEnvironment,
    status: fmi3Status,
    category: fmi3String,
    message: fmi3String,
) {
    // SAFETY: section 2.3.1 requires the same of FMI 3.0.
    unsafe { Log::remember(environment, status, category, message) }
}
