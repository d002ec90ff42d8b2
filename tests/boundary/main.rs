//! The FMU as an importer sees it: the C functions of FMI 2.0, called as the standard, careless masters
//! and C programs call them.

#[path = "../../crates/fmi2-export/tests/support/mod.rs"]
mod support;

#[path = "../c/mod.rs"]
mod c;

mod c_programs;
mod call_table;
mod co_simulation;
mod derivatives;
mod exact;
mod importers;
mod logging;
mod model_exchange;
mod modes;
mod refusals;
mod saved_states;
mod serialized;
mod settable;
mod tolerances;

use prw_testbed::fmi2_functions;
use std::ffi::CStr;

const GUID_TEXT: &str = env!("FMU_GUID");
/// The guid as C string.
const GUID: &CStr = match CStr::from_bytes_with_nul(concat!(env!("FMU_GUID"), "\0").as_bytes()) {
    Ok(guid) => guid,
    Err(_) => panic!("the guid has no zero byte inside"),
};
