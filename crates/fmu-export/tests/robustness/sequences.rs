//! Random sequences of calls; `fuzz` lets libFuzzer look for others.

use crate::models::*;
use fmu_test_kit::careless::{RunBytes, Tally, run, run_seeds};
use fmu_test_kit::{FUNCTIONS, Importer, fmi3};
use std::io::{Cursor, Read as _};

/// All test models but the faulty one.
const MODELS: [(&str, RunBytes); 10] = [
    ("oscillator", run::<Importer, Oscillator>),
    ("ball", run::<Importer, Ball>),
    ("counter", run::<Importer, Counter>),
    ("talker", run::<Importer, Talker>),
    ("sum", run::<Importer, Sum>),
    ("fuse", run::<Importer, Fuse>),
    ("lazy", run::<Importer, Lazy>),
    ("balance", run::<Importer, Balance>),
    ("motor", run::<Importer, Motor>),
    ("rod", run::<Importer, Rod>),
];

/// The same in FMI 3.0, with those that have more than FMI 2.0.
const MODELS_OF_FMI3: [(&str, RunBytes); 10] = [
    ("oscillator", run::<fmi3::Importer, Oscillator>),
    ("ball", run::<fmi3::Importer, Ball>),
    ("counter", run::<fmi3::Importer, Counter>),
    ("talker", run::<fmi3::Importer, Talker>),
    ("sum", run::<fmi3::Importer, Sum>),
    ("fuse", run::<fmi3::Importer, Fuse>),
    ("ticker", run::<fmi3::Importer, Ticker>),
    ("palette", run::<fmi3::Importer, Palette>),
    ("motor", run::<fmi3::Importer, Motor>),
    ("rod", run::<fmi3::Importer, Rod>),
];

/// What never succeeds: there are no asynchronous steps, and no model here has the rest.
const NEVER: &str = "fmi2CancelStep fmi2GetStatus fmi2GetIntegerStatus fmi2GetStringStatus fmi3GetClock \
    fmi3SetClock fmi3EnterConfigurationMode fmi3ExitConfigurationMode \
    fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies fmi3GetIntervalDecimal \
    fmi3GetIntervalFraction fmi3GetShiftDecimal fmi3GetShiftFraction fmi3SetIntervalDecimal \
    fmi3SetIntervalFraction fmi3SetShiftDecimal fmi3SetShiftFraction fmi3EvaluateDiscreteStates \
    fmi3ActivateModelPartition";

/// Every function succeeds at times, and at times is refused.
fn check_counts(tally: &Tally, functions: &[&str]) {
    for name in functions {
        assert_eq!(
            tally[name][0] == 0,
            NEVER.split(' ').any(|never| never == *name),
            "{name}: {:?}",
            tally[name]
        );
        assert!(tally[name][2] > 0, "{name} is never refused");
    }
}

#[test]
fn no_sequence_of_calls_breaks_a_promise() {
    let tally = run_seeds(3, &MODELS);
    assert_eq!(tally.len(), 44, "every function is called");
    check_counts(&tally, FUNCTIONS);
}

#[test]
fn no_sequence_of_calls_of_fmi3_breaks_a_promise() {
    let tally = run_seeds(3, &MODELS_OF_FMI3);
    check_counts(&tally, fmi3::FUNCTIONS);
    check_counts(&tally, &["fmi3InstantiateCoSimulation", "fmi3InstantiateModelExchange"]);
}

/// The inputs that libFuzzer found worth keeping, for every test model in both FMI versions.
#[test]
fn the_corpus_breaks_no_promise() {
    let archive = include_bytes!("../../fuzz/corpus.zip");
    let mut archive = zip::ZipArchive::new(Cursor::new(archive)).expect("a zip archive");
    let mut tally = Tally::new();
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).expect("a file of the archive");
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).expect("an intact file");
        for (model, session) in MODELS.iter().chain(&MODELS_OF_FMI3) {
            println!("{model}, {:?}", file.name());
            session(&bytes, &mut tally);
        }
    }
    println!("{tally:?}");
    assert!(!tally.is_empty(), "the corpus is empty");
}
