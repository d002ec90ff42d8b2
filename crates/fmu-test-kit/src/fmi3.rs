//! FMI 3.0: an instance as an importer uses it.

use crate::importer::{Arguments, Log, Message, importer, to_bool};
pub use fmi_abi::fmi3::Functions;
use fmi_abi::fmi3::types::*;
use fmu_export::{Standard, Status};
use std::ptr::null_mut;

fmi_abi::fmi3_functions!(importer, fmi3FreeInstance;);

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
