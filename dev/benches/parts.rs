//! Benchmarks of the calculations in a step, without the C interface: the median duration of a call.

use prw_testbed::propagator::{Propagator, StepMatrices};
use prw_testbed::{BUILT_IN, Testbed};
use std::hint::black_box;
use std::time::Instant;

/// Prints the median duration of a call of `work`.
fn measure<R>(what: &str, mut work: impl FnMut() -> R) {
    const CALLS: u32 = 1000;
    let mut durations: [f64; 101] = std::array::from_fn(|_| {
        let begin = Instant::now();
        (0..CALLS).for_each(|_| drop(black_box(work())));
        begin.elapsed().as_secs_f64() / f64::from(CALLS)
    });
    durations.sort_by(f64::total_cmp);
    println!("{what}: {:.1} ns", 1e9 * durations[durations.len() / 2]);
}

fn main() {
    let mut testbed = Testbed::new(BUILT_IN).expect("Table 1 is valid");
    let system = *testbed.system();
    measure("equations from parameters", || Testbed::new(black_box(BUILT_IN)));
    measure("propagator of one subsystem, 1 ms", || {
        Propagator::new(black_box(&system.pitch), black_box(1e-3))
    });
    measure("step matrices, 1 ms", || StepMatrices::new(black_box(&system), black_box(1e-3)));
    measure("step of the testbed, 1 ms", || testbed.step(black_box(1e-3)));
    let mut saved = testbed.clone();
    measure("save and restore", || {
        saved.clone_from(black_box(&testbed));
        testbed.clone_from(black_box(&saved));
    });
}
