//! libFuzzer searches for bytes that decode to calls after which an FMU violates one of its guarantees, which
//! `fmu_test_kit::fault_injection` checks. The AddressSanitizer also detects invalid accesses to memory.
#![no_main]

use fmu_test_kit::fault_injection::{RunBytes, Tally, run};
use fmu_test_kit::{Importer, fmi3};
use libfuzzer_sys::fuzz_target;
use std::sync::atomic::{AtomicU64, Ordering};
use fmu_test_kit::models::*;

/// Test models in FMI 2.0 and FMI 3.0. Add new models at the end, because the last byte of each input in
/// `corpus.zip` selects a model by its index.
///
/// Any exported model can be added, for example `run::<Importer, my_model::MyModel>` with that crate as a dependency.
const MODELS: [RunBytes; 16] = [
    run::<Importer, Oscillator>,
    run::<Importer, Ball>,
    run::<Importer, Counter>,
    run::<Importer, Talker>,
    run::<Importer, Lazy>,
    run::<Importer, Fuse>,
    run::<fmi3::Importer, Oscillator>,
    run::<fmi3::Importer, Ball>,
    run::<fmi3::Importer, Counter>,
    run::<fmi3::Importer, Talker>,
    run::<fmi3::Importer, Lazy>,
    run::<fmi3::Importer, Fuse>,
    run::<fmi3::Importer, Meter>,
    run::<fmi3::Importer, Palette>,
    run::<Importer, Rod>,
    run::<fmi3::Importer, Rod>,
];

static CALLS: AtomicU64 = AtomicU64::new(0);
const REPORT_EVERY: u64 = 1_000_000;

fuzz_target!(|bytes: &[u8]| {
    // The last byte selects the model and the FMI version; the calls are read from the front.
    let Some((which, calls)) = bytes.split_last() else { return };
    let mut tally = Tally::new();
    MODELS[usize::from(*which) % MODELS.len()](calls, &mut tally);
    let calls: u64 = tally.values().flatten().sum();
    let before = CALLS.fetch_add(calls, Ordering::Relaxed);
    if before / REPORT_EVERY != (before + calls) / REPORT_EVERY {
        eprintln!("{} million calls", (before + calls) / REPORT_EVERY);
    }
});
