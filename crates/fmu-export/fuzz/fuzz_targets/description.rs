//! libFuzzer searches for model descriptions with which the parser of fmu-run panics.
#![no_main]

#[path = "../../../fmu-run/tests/readers/harness.rs"]
#[allow(dead_code, reason = "each target uses one function")]
mod harness;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| harness::description(bytes));
