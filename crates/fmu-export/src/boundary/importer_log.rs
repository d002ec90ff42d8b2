//! The importer's log callback.

use crate::log::Message;
use fmi_abi::c_types::c_void;
use fmi_abi::fmi2::types::fmi2CallbackLogger;
use fmi_abi::fmi3::types::fmi3LogMessageCallback;
use std::ffi::CString;

/// The callback, whose type depends on the FMI version.
#[derive(Clone, Copy)]
#[cfg_attr(
    target_family = "wasm",
    allow(dead_code, reason = "the C code around the module calls the importer")
)]
pub(crate) enum Callback {
    Fmi2(fmi2CallbackLogger),
    Fmi3(fmi3LogMessageCallback),
}

/// The callback, if the importer has one, and the arguments that the callback gets with every call. The arguments are
/// copied, because the structure in which FMI 2.0 passes them may be invalid after `fmi2Instantiate`.
#[cfg_attr(
    target_family = "wasm",
    allow(dead_code, reason = "the C code around the module calls the importer")
)]
pub(crate) struct ImporterLog {
    pub callback: Option<Callback>,
    pub environment: *mut c_void,
    pub instance_name: CString,
}

#[cfg(target_family = "wasm")]
#[link(wasm_import_module = "fmu")]
unsafe extern "C" {
    safe fn fmu_log(
        status: fmi_abi::Status,
        category: *const fmi_abi::c_types::c_char,
        message: *const fmi_abi::c_types::c_char,
    );
}

/// Passes a message to the code around the module.
#[cfg(target_family = "wasm")]
pub(super) fn log(message: &Message) {
    fmu_log(message.status, message.category().as_ptr(), message.printable().as_ptr());
}

impl ImporterLog {
    #[cfg(target_family = "wasm")]
    pub fn deliver(&self, message: &Message) {
        log(message);
    }

    #[cfg(not(target_family = "wasm"))]
    pub fn deliver(&self, message: &Message) {
        let Some(callback) = self.callback else { return };
        let (category, string) = (message.category().as_ptr(), message.printable());
        // SAFETY: the importer guarantees that the logger works until the instance is freed. All strings are
        // NUL-terminated. The message contains no format directive, so the variadic logger reads no further
        // arguments.
        unsafe {
            match callback {
                Callback::Fmi2(logger) => logger(
                    self.environment,
                    self.instance_name.as_ptr(),
                    message.status as _,
                    category,
                    string.as_ptr(),
                ),
                Callback::Fmi3(logger) => {
                    logger(self.environment, message.status as _, category, string.as_ptr());
                }
            }
        }
    }
}
