//! Random sequences of calls; `make fuzz` lets libFuzzer look for others.

use crate::session::{self, Tally};
use crate::support::FUNCTIONS_OF_COMPONENTS;
use std::time::{Duration, Instant};

/// Bytes that look random and are the same in every run (splitmix64).
pub fn random_bytes(seed: u64, count: usize) -> Vec<u8> {
    const STEP: u64 = 0x9e37_79b9_7f4a_7c15;
    let mix = |z: u64| {
        let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    };
    // A begin of its own for each seed: from a multiple of the step the same bytes would come, only later.
    let begin = mix(seed ^ STEP);
    (1..=count.div_ceil(8) as u64)
        .flat_map(|n| mix(begin.wrapping_add(n.wrapping_mul(STEP))).to_le_bytes())
        .take(count)
        .collect()
}

/// Sequences from seeds 0, 1, ... for some seconds, `ROBUSTNESS_SECONDS` if that is set, and at least 20 of
/// them, so that the checks below do not depend on the machine.
#[test]
fn no_sequence_of_calls_breaks_a_promise() {
    let seconds = std::env::var("ROBUSTNESS_SECONDS").map_or(3, |text| text.parse().expect("a number"));
    let end = Instant::now() + Duration::from_secs(seconds);
    let mut tally = Tally::new();
    let mut seed = 0;
    while seed < 20 || Instant::now() < end {
        println!("seed {seed}"); // for who looks into a failure
        session::run(&random_bytes(seed, 1 << 16), &mut tally);
        seed += 1;
    }
    let calls: u64 = tally.values().flatten().sum();
    println!("{calls} calls in {seed} sequences; OK, discarded, refused:");
    for (function, counts) in &tally {
        println!("{function:36}{counts:9?}");
    }
    assert_eq!(tally.len(), 44, "every function is called");
    let never = |column: usize, expected: &[&str]| {
        for name in FUNCTIONS_OF_COMPONENTS {
            assert_eq!(tally[name][column] == 0, expected.contains(name), "{name}: {:?}", tally[name]);
        }
    };
    // Only these never succeed: there are no asynchronous steps.
    never(0, &["fmi2CancelStep", "fmi2GetStatus", "fmi2GetIntegerStatus", "fmi2GetStringStatus"]);
    never(2, &[]);
}

/// What libFuzzer found worth keeping.
#[test]
fn the_corpus_breaks_no_promise() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/fuzz/corpus/calls");
    let mut tally = Tally::new();
    for entry in std::fs::read_dir(folder).expect("the corpus is committed") {
        let path = entry.expect("a readable folder").path();
        println!("{}", path.display());
        session::run(&std::fs::read(path).expect("a readable file"), &mut tally);
    }
    assert!(!tally.is_empty(), "the corpus is empty");
}
