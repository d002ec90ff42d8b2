//! FMI 3.0: an instance as an importer uses it.

use crate::importer::{Arguments, Log, Message, importer, remember, to_bool};
pub use fmi_abi::fmi3::Functions;
use fmi_abi::fmi3::types::*;
use std::ffi::{CStr, c_int, c_void};
use std::ptr::{null, null_mut};

fmi_abi::fmi3_functions!(importer, fmi3FreeInstance;);

unsafe extern "C" fn log_message(
    environment: fmi3InstanceEnvironment,
    status: c_int,
    category: fmi3String,
    message: fmi3String,
) {
    // SAFETY: section 2.3.1 of FMI 3.0 requires NUL-terminated strings. The environment is NULL or the log. FMI 3.0 does not
    // pass the name of the instance, so NULL takes its place.
    unsafe { remember(environment, null(), status, category, message) }
}

/// Calls the instantiation function of the interface type.
fn make(functions: &Functions, arguments: &Arguments, log: &Log) -> fmi3Instance {
    let pointer = |string: Option<&CStr>| string.map_or(null(), CStr::as_ptr);
    let name = pointer(arguments.instance_name);
    let token = pointer(arguments.guid.as_deref());
    // FMI 3.0 needs a path, not a URI.
    let path = arguments.resource_location.map(|location| {
        let bytes = location.to_bytes_with_nul();
        CStr::from_bytes_with_nul(bytes.strip_prefix(b"file://").unwrap_or(bytes))
            .expect("the terminating NUL is kept")
    });
    let resources = pointer(path);
    let environment = match arguments.environment {
        true => (&raw const *log).cast_mut().cast(),
        false => null_mut(),
    };
    let callback = arguments.logger.then_some(log_message as fmi3LogMessageCallback);
    let (visible, logging_on) = (arguments.visible.into(), arguments.logging_on);
    let required = arguments.required_intermediate_variables;
    // SAFETY: each pointer is NULL or points to a live value.
    unsafe {
        match arguments.fmu_type {
            0 => (functions.fmi3InstantiateModelExchange)(
                name,
                token,
                resources,
                visible,
                logging_on,
                environment,
                callback,
            ),
            2 => (functions.fmi3InstantiateScheduledExecution)(
                name,
                token,
                resources,
                visible,
                logging_on,
                environment,
                callback,
                None,
                None,
                None,
            ),
            _ => (functions.fmi3InstantiateCoSimulation)(
                name,
                token,
                resources,
                visible,
                logging_on,
                arguments.event_mode_used,
                arguments.early_return_allowed,
                required.as_ptr(),
                required.len(),
                environment,
                callback,
                None,
            ),
        }
    }
}

/// Results of `fmi3DoStep`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[allow(missing_docs, reason = "the fields are results of fmi3DoStep in section 4.2.1 of FMI 3.0")]
pub struct Stepped {
    pub event_handling_needed: bool,
    pub terminate: bool,
    pub early_return: bool,
    pub last_successful_time: f64,
}

/// Functions whose results exist only in FMI 3.0.
impl Importer {
    /// Performs a step.
    ///
    /// # Errors
    /// Returns the status if it is not OK.
    pub fn do_step(&self, point: f64, step_size: f64) -> Result<Stepped, Status> {
        let (mut event, mut terminate, mut early, mut time) = (2, 2, 2, f64::NAN);
        let status =
            self.fmi3DoStep(point, step_size, fmi3True, &mut event, &mut terminate, &mut early, &mut time);
        if status != Status::Ok {
            return Err(status);
        }
        let [event_handling_needed, terminate, early_return] =
            [event, terminate, early].map(|flag| to_bool(flag.into()));
        Ok(Stepped { event_handling_needed, terminate, early_return, last_successful_time: time })
    }
}
