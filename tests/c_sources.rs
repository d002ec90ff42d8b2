//! Compares a library that was compiled from the C sources of the FMU with the functions of this program, which are
//! compiled from Rust. `make test-source-fmu` names the library in the environment variable `FMU_LIBRARY`.

use fmu_test_kit::fault_injection::{random_bytes, record};
use fmu_test_kit::functions_of;
use prw_testbed::TestbedFmu;

/// Checks that random sequences of calls return bit-identical values, the same statuses and the same messages.
#[test]
#[ignore = "needs compiled C sources"]
fn random_sessions_give_equal_results() {
    assert!(
        std::env::var_os("FMU_LIBRARY").is_some(),
        "FMU_LIBRARY must name the library compiled from the C sources; run make test-source-fmu"
    );
    let sessions = std::env::var("SESSIONS").map_or(300, |value| value.parse().expect("a number"));
    let (mut calls, mut rejected) = (0, 0);
    for seed in 0..sessions {
        let bytes = random_bytes(seed, 1 << 12);
        let native = record::<TestbedFmu>(fmu_export::fmi2::functions::<TestbedFmu>(), &bytes);
        let compiled = record::<TestbedFmu>(functions_of::<TestbedFmu>(), &bytes);
        for (native, compiled) in native.iter().zip(&compiled) {
            assert_eq!(native, compiled, "seed {seed}");
        }
        assert_eq!(native.len(), compiled.len(), "seed {seed}");
        calls += native.len();
        rejected += native.iter().filter(|result| result.contains("Error")).count();
    }
    println!("{calls} calls in {sessions} sessions, {rejected} rejected: equal bits, statuses and messages");
}
