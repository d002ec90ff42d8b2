//! Random sequences of calls of FMI 3.0.

use crate::toys::*;
use fmu_run::careless::fmi3::run;
use fmu_run::careless::{Tally, random_bytes};
use fmu_run::fmi3::FUNCTIONS;
use std::time::{Duration, Instant};

type Session = fn(&[u8], &mut Tally);

const TOYS: [(&str, Session); 8] = [
    ("oscillator", run::<Oscillator>),
    ("ball", run::<Ball>),
    ("counter", run::<Counter>),
    ("talker", run::<Talker>),
    ("sum", run::<Sum>),
    ("fuse", run::<Fuse>),
    ("ticker", run::<Ticker>),
    ("palette", run::<Palette>),
];

/// What no model here has.
const NEVER: [&str; 14] = [
    "fmi3GetClock",
    "fmi3SetClock",
    "fmi3EnterConfigurationMode",
    "fmi3ExitConfigurationMode",
    "fmi3GetIntervalDecimal",
    "fmi3GetIntervalFraction",
    "fmi3GetShiftDecimal",
    "fmi3GetShiftFraction",
    "fmi3SetIntervalDecimal",
    "fmi3SetIntervalFraction",
    "fmi3SetShiftDecimal",
    "fmi3SetShiftFraction",
    "fmi3EvaluateDiscreteStates",
    "fmi3ActivateModelPartition",
];

/// As for FMI 2.0: for some seconds, `ROBUSTNESS_SECONDS` if that is set.
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
    println!("{calls} calls in {seed} sequences of each toy; OK, -, refused:");
    for (function, counts) in &tally {
        println!("{function:40}{counts:9?}");
    }
    for name in FUNCTIONS {
        assert_eq!(tally[name][0] == 0, NEVER.contains(name), "{name}: {:?}", tally[name]);
        assert!(tally[name][2] > 0, "{name} is never refused");
    }
}
