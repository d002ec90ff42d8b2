//! Functions for the life cycle of an instance (sections 2.1.5 and 2.1.6 of FMI 2.0, 2.3 of FMI 3.0), and for the
//! settings of its log.
//!
//! # Safety
//! The importer guarantees the contract of [`fmi2`](crate::fmi2#safety) or [`fmi3`](crate::fmi3#safety).

use super::{in_slice, string};
use crate::export::Exported;
use crate::instance::{Instance, Outcome, reject};
use crate::log::Logger;
use crate::model::Experiment;
use fmi_abi::Category;
use fmi_abi::c_types::c_char;
use std::ffi::CStr;

/// Converts the importer's arguments to an [`Experiment`]; `Boolean` is the Boolean type of the FMI version.
pub(crate) fn experiment<Boolean: Default + PartialEq>(
    tolerance_defined: Boolean,
    tolerance: f64,
    start_time: f64,
    stop_time_defined: Boolean,
    stop_time: f64,
) -> Experiment {
    let is_false = Boolean::default();
    Experiment {
        start_time,
        stop_time: (stop_time_defined != is_false).then_some(stop_time),
        tolerance: (tolerance_defined != is_false).then_some(tolerance),
    }
}

pub unsafe fn exit_initialization_mode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.exit_initialization_mode()
}

pub unsafe fn enter_event_mode<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.enter_event_mode()
}

pub unsafe fn terminate<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.terminate();
    Ok(())
}

pub unsafe fn reset<M: Exported>(instance: &mut Instance<M>) -> Outcome {
    instance.reset()
}

pub unsafe fn set_debug_logging<M: Exported, Boolean: Default + PartialEq>(
    instance: &mut Instance<M>,
    on: Boolean,
    count: usize,
    categories: *const *const c_char,
) -> Outcome {
    let on = on != Boolean::default();
    // SAFETY: by contract, `categories` is NULL or an array of this length.
    let names = unsafe { in_slice(categories, count, "categories") }?;
    let mut found = 0;
    for name in names {
        // SAFETY: by contract, each name is NULL or a string.
        let name = unsafe { string(*name) }.map_or(&b""[..], CStr::to_bytes);
        let Some(bit) = Logger::find(name) else {
            let known = Category::ALL.map(|category| category.name().to_string_lossy()).join(", ");
            return reject(format!(
                "there is no log category '{}'; the categories are {known}",
                String::from_utf8_lossy(name)
            ));
        };
        found |= bit;
    }
    match count {
        0 => instance.logger.set_all(on),
        _ => instance.logger.set(found, on),
    }
    Ok(())
}
