//! libFuzzer looks for bytes that, read as calls of the FMU's functions, break a promise of
//! tests/robustness/session.rs or, under the AddressSanitizer, the memory.
#![no_main]

#[path = "../../tests/robustness/arguments.rs"]
mod arguments;
#[path = "../../tests/robustness/calls.rs"]
mod calls;
#[allow(dead_code, reason = "what the tests of the boundary need")]
#[path = "../../tests/boundary/serialized.rs"]
mod serialized;
#[path = "../../tests/robustness/session.rs"]
mod session;
#[path = "../../crates/fmi2-export/tests/support/mod.rs"]
mod support;

use fmi2_export::Model;
use libfuzzer_sys::fuzz_target;
use prw_testbed::{TestbedFmu, fmi2_functions};
use std::ffi::CStr;
use std::sync::atomic::{AtomicU64, Ordering};

const GUID_TEXT: &str = TestbedFmu::INFO.guid;
const GUID_BYTES: [u8; GUID_TEXT.len() + 1] = {
    let mut bytes = [0; GUID_TEXT.len() + 1];
    bytes.split_at_mut(GUID_TEXT.len()).0.copy_from_slice(GUID_TEXT.as_bytes());
    bytes
};
/// The guid as C string.
const GUID: &CStr = match CStr::from_bytes_with_nul(&GUID_BYTES) {
    Ok(guid) => guid,
    Err(_) => panic!("the guid has no zero byte inside"),
};

static CALLS: AtomicU64 = AtomicU64::new(0);
const REPORT_EVERY: u64 = 1_000_000;

fuzz_target!(|bytes: &[u8]| {
    let mut tally = session::Tally::new();
    session::run(bytes, &mut tally);
    let calls: u64 = tally.values().flatten().sum();
    let before = CALLS.fetch_add(calls, Ordering::Relaxed);
    if before / REPORT_EVERY != (before + calls) / REPORT_EVERY {
        eprintln!("{} million calls", (before + calls) / REPORT_EVERY);
    }
});
