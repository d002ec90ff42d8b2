//! The FMU under abuse: any calls in any order, threads, real-time limits, loading and unloading, extremes.
//! docs/robustness.md has the table of what was tried.

#[path = "../../crates/fmi2-export/tests/support/mod.rs"]
mod support;

#[path = "../c/mod.rs"]
mod c;

#[allow(dead_code, reason = "what the tests of the boundary need")]
#[path = "../boundary/serialized.rs"]
mod serialized;

mod arguments;
mod calls;
mod files;
mod lifecycle;
mod realtime;
mod sequences;
mod session;
mod threads;
mod time;

use prw_testbed::fmi2_functions;
use std::ffi::CStr;

/// The guid as C string.
const GUID: &CStr = match CStr::from_bytes_with_nul(concat!(env!("FMU_GUID"), "\0").as_bytes()) {
    Ok(guid) => guid,
    Err(_) => panic!("the guid has no zero byte inside"),
};
