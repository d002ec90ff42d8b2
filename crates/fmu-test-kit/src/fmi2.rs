//! FMI 2.0: an instance as an importer uses it.

use crate::importer::{Arguments, Log, Message, importer, remember};
pub use fmi_abi::fmi2::Functions;
use fmi_abi::fmi2::types::*;
use std::ffi::{CStr, c_int, c_void};
use std::ptr::{null, null_mut};

fmi_abi::fmi2_functions!(importer, fmi2FreeInstance;);

/// The log callback, declared without its variadic arguments (`...`), because stable Rust cannot define a variadic
/// function. On every platform of this project, variadic and plain calls pass named arguments in the same way. Miri
/// checks the calling convention, so the function is variadic there.
unsafe extern "C" fn log_message(
    environment: fmi2ComponentEnvironment,
    instance_name: fmi2String,
    status: c_int,
    category: fmi2String,
    message: fmi2String,
    #[cfg(miri)] _: ...
) {
    // SAFETY: section 2.1.5 of FMI 2.0 requires that each string is NULL or NUL-terminated. The environment is NULL or
    // the log.
    unsafe { remember(environment, instance_name, status, category, message) }
}

/// Calls `fmi2Instantiate`. Afterwards overwrites the callbacks structure and the instance name, because the
/// FMU must have copied them.
fn make(functions: &Functions, arguments: &Arguments, log: &Log) -> fmi2Component {
    let pointer = |string: Option<&CStr>| string.map_or(null(), CStr::as_ptr);
    let mut name = arguments.instance_name.map(|name| name.to_bytes_with_nul().to_vec());
    #[cfg(not(miri))]
    let logger: unsafe extern "C" fn(_, _, _, _, _) = log_message;
    #[cfg(miri)]
    let logger: fmi2CallbackLogger = log_message;
    let mut callbacks = fmi2CallbackFunctions {
        // SAFETY: the documentation of `log_message` explains why both types have compatible calls.
        logger: arguments.logger.then(|| unsafe { std::mem::transmute::<_, fmi2CallbackLogger>(logger) }),
        allocate_memory: None,
        free_memory: None,
        step_finished: None,
        component_environment: match arguments.environment {
            true => (&raw const *log).cast_mut().cast(),
            false => null_mut(),
        },
    };
    // SAFETY: each pointer is NULL or points to a live value.
    let component = unsafe {
        (functions.fmi2Instantiate)(
            name.as_ref().map_or(null(), |name| name.as_ptr().cast()),
            arguments.fmu_type,
            pointer(arguments.guid.as_deref()),
            pointer(arguments.resource_location),
            if arguments.callbacks { &raw const callbacks } else { null() },
            arguments.visible.into(),
            arguments.logging_on.into(),
        )
    };
    callbacks.logger = None;
    callbacks.component_environment = null_mut();
    if let Some(name) = &mut name {
        name.fill(b'X');
    }
    std::hint::black_box((&callbacks, &name));
    component
}

/// Functions that exist only in FMI 2.0.
#[allow(clippy::missing_panics_doc, reason = "the functions are for tests and panic on purpose")]
impl Importer {
    /// Returns the version and the platform of the library; both functions need no instance (section 2.1.4 of FMI 2.0).
    pub fn version_and_platform(&self) -> [&CStr; 2] {
        let Functions { fmi2GetVersion, fmi2GetTypesPlatform, .. } = self.functions;
        // SAFETY: both functions return strings that stay valid while the library is loaded.
        [fmi2GetVersion, fmi2GetTypesPlatform].map(|function| unsafe { CStr::from_ptr(function()) })
    }

    /// Calls `fmi2SetDebugLogging` with these categories.
    pub fn set_debug_logging(&self, on: bool, categories: &[&CStr]) -> Status {
        let pointers: Vec<_> = categories.iter().map(|category| category.as_ptr()).collect();
        self.fmi2SetDebugLogging(on.into(), pointers.len(), pointers.as_ptr())
    }
}
