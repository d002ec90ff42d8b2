//! Random sequences of calls; `fuzz` lets libFuzzer look for others.

use crate::toys::*;
use fmu_test_kit::FUNCTIONS;
use fmu_test_kit::careless::{RunBytes, Tally, run, run_seeds};

/// All toys but the faulty one.
const TOYS: [(&str, RunBytes); 8] = [
    ("oscillator", run::<Oscillator>),
    ("ball", run::<Ball>),
    ("counter", run::<Counter>),
    ("talker", run::<Talker>),
    ("sum", run::<Sum>),
    ("fuse", run::<Fuse>),
    ("lazy", run::<Lazy>),
    ("balance", run::<Balance>),
];

#[test]
fn no_sequence_of_calls_breaks_a_promise() {
    let tally = run_seeds(3, &TOYS);
    assert_eq!(tally.len(), 44, "every function is called");
    let never = |column: usize, expected: &[&str]| {
        for name in FUNCTIONS {
            assert_eq!(tally[name][column] == 0, expected.contains(name), "{name}: {:?}", tally[name]);
        }
    };
    // Only these never succeed: there are no asynchronous steps.
    never(0, &["fmi2CancelStep", "fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"]);
    never(2, &[]);
}

/// What libFuzzer found worth keeping, for every toy in both standards.
#[test]
fn the_corpus_breaks_no_promise() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/corpus/calls");
    let mut tally = Tally::new();
    for entry in std::fs::read_dir(folder).expect("the corpus is committed") {
        let path = entry.expect("a readable folder").path();
        let bytes = std::fs::read(&path).expect("a readable file");
        for (toy, session) in TOYS.iter().chain(&crate::fmi3::TOYS) {
            println!("{toy}, {}", path.display());
            session(&bytes, &mut tally);
        }
    }
    assert!(!tally.is_empty(), "the corpus is empty");
}
