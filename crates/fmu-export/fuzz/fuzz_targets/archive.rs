//! libFuzzer searches for zip files with which opening an FMU or a system panics, or writes outside of its directory.
#![no_main]

#[path = "../../../fmu-run/tests/readers/harness.rs"]
#[allow(dead_code, reason = "each target uses one function")]
mod harness;

use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;
use tempfile::TempDir;

static DIRECTORY: LazyLock<TempDir> = LazyLock::new(|| TempDir::new().expect("a directory"));

fuzz_target!(|bytes: &[u8]| harness::archive(DIRECTORY.path(), bytes));
