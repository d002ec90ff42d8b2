//! Random sequences of calls of FMI 3.0.

use crate::toys::*;
use fmu_test_kit::careless::fmi3::run;
use fmu_test_kit::careless::{RunBytes, run_seeds};
use fmu_test_kit::fmi3::FUNCTIONS;

pub const TOYS: [(&str, RunBytes); 8] = [
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
const NEVER: [&str; 16] = [
    "fmi3GetClock",
    "fmi3SetClock",
    "fmi3EnterConfigurationMode",
    "fmi3ExitConfigurationMode",
    "fmi3GetNumberOfVariableDependencies",
    "fmi3GetVariableDependencies",
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

#[test]
fn no_sequence_of_calls_breaks_a_promise() {
    let tally = run_seeds(3, &TOYS);
    for name in FUNCTIONS {
        assert_eq!(tally[name][0] == 0, NEVER.contains(name), "{name}: {:?}", tally[name]);
        assert!(tally[name][2] > 0, "{name} is never refused");
    }
    for name in ["fmi3InstantiateCoSimulation", "fmi3InstantiateModelExchange"] {
        assert!(tally[name][0] > 0 && tally[name][2] > 0, "{name}: {:?}", tally[name]);
    }
}
