//! Any calls in any order; the library loaded and unloaded beside another FMU. (The rest of docs/robustness.md is tested
//! in crates/fmu-export, on toy models.)

use fmu_run::careless::{Tally, random_bytes, run};
use prw_testbed::TestbedFmu;
use std::time::{Duration, Instant};

/// Sequences from seeds 0, 1, ... for some seconds, `ROBUSTNESS_SECONDS` if that is set.
#[test]
fn no_sequence_of_calls_breaks_a_promise() {
    let seconds = std::env::var("ROBUSTNESS_SECONDS").map_or(3, |text| text.parse().expect("a number"));
    let end = Instant::now() + Duration::from_secs(seconds);
    let mut tally = Tally::new();
    let mut seed = 0;
    while seed < 4 || Instant::now() < end {
        println!("seed {seed}"); // for who looks into a failure
        run::<TestbedFmu>(&random_bytes(seed, 1 << 16), &mut tally);
        seed += 1;
    }
    let calls: u64 = tally.values().flatten().sum();
    println!("{calls} calls in {seed} sequences");
    assert_eq!(tally.len(), 44, "every function is called");
}

/// The memory grows by less than 100 bytes a round over the last nine tenths of the rounds. Counting pages has a noise of
/// some 100 KiB, however many rounds there are. An instance forgotten in each would be 50 times as much; `make sanitize`
/// has valgrind look for every byte.
#[cfg(target_os = "linux")]
#[test]
fn unloading_leaves_nothing_behind() {
    use fmu_run::c_programs::{command, compile, library, output};
    use std::path::Path;
    const ROUNDS: i64 = 3000;
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("crates/fmu-export/tests/c/reload.c");
    let program = compile(&source, Path::new(env!("CARGO_TARGET_TMPDIR")));
    for names in [&["prw_testbed"][..], &["prw_testbed", "prw_controller"]] {
        let mut command = command(&program);
        command.arg(ROUNDS.to_string()).args(names.iter().map(|name| library(name)));
        let printed = output(&mut command, "the compiled program does not run");
        let memory: Vec<i64> = printed.lines().map(|line| line.parse().unwrap()).collect();
        let [begin, end] = memory[..] else { panic!("two numbers expected: {printed}") };
        let growth = (end - begin) * 1024;
        assert!(growth < 100 * ROUNDS, "{names:?}: {growth} bytes more");
    }
}
