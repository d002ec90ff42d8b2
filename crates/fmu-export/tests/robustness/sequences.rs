//! Random sequences of calls; `fuzz` lets libFuzzer look for others.

use crate::toys::*;
use fmu_run::FUNCTIONS;
use fmu_run::careless::{Tally, random_bytes, run};
use std::time::{Duration, Instant};

type Session = fn(&[u8], &mut Tally);

/// All toys but the faulty one.
const TOYS: [(&str, Session); 7] = [
    ("oscillator", run::<Oscillator>),
    ("ball", run::<Ball>),
    ("counter", run::<Counter>),
    ("talker", run::<Talker>),
    ("sum", run::<Sum>),
    ("fuse", run::<Fuse>),
    ("lazy", run::<Lazy>),
];

/// Sequences from seeds 0, 1, ... for some seconds, `ROBUSTNESS_SECONDS` if that is set, and at least 3 of them for each
/// toy, so that the checks below do not depend on the machine.
#[test]
fn no_sequence_of_calls_breaks_a_promise() {
    let seconds = std::env::var("ROBUSTNESS_SECONDS").map_or(3, |text| text.parse().expect("a number"));
    let end = Instant::now() + Duration::from_secs(seconds);
    let mut tally = Tally::new();
    let mut seed = 0;
    while seed < 3 || Instant::now() < end {
        for (toy, session) in TOYS {
            println!("{toy}, seed {seed}"); // for who looks into a failure
            session(&random_bytes(seed, 1 << 16), &mut tally);
        }
        seed += 1;
    }
    let calls: u64 = tally.values().flatten().sum();
    println!("{calls} calls in {seed} sequences of each toy; OK, discarded, refused:");
    for (function, counts) in &tally {
        println!("{function:36}{counts:9?}");
    }
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

/// What libFuzzer found worth keeping, for every toy.
#[test]
fn the_corpus_breaks_no_promise() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/corpus/calls");
    let mut tally = Tally::new();
    for entry in std::fs::read_dir(folder).expect("the corpus is committed") {
        let path = entry.expect("a readable folder").path();
        let bytes = std::fs::read(&path).expect("a readable file");
        for (toy, session) in TOYS {
            println!("{toy}, {}", path.display());
            session(&bytes, &mut tally);
        }
    }
    assert!(!tally.is_empty(), "the corpus is empty");
}
