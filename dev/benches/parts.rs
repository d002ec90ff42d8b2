//! Benchmarks of the calculations in a step, without the C interface.

use criterion::{Criterion, criterion_group, criterion_main};
use prw_testbed::propagator::{Propagator, StepMatrices};
use prw_testbed::{BUILT_IN, Testbed};
use std::hint::black_box;

fn parts(c: &mut Criterion) {
    let mut testbed = Testbed::new(BUILT_IN).expect("Table 1 is valid");
    let system = *testbed.system();

    c.bench_function("equations from parameters", |b| {
        b.iter(|| Testbed::new(black_box(BUILT_IN)));
    });
    c.bench_function("propagator of one subsystem, 1 ms", |b| {
        b.iter(|| Propagator::new(black_box(&system.pitch), black_box(1e-3)));
    });
    c.bench_function("step matrices, 1 ms", |b| {
        b.iter(|| StepMatrices::new(black_box(&system), black_box(1e-3)));
    });
    c.bench_function("step of the testbed, 1 ms", |b| {
        b.iter(|| testbed.step(black_box(1e-3)));
    });
    c.bench_function("save and restore", |b| {
        let mut saved = testbed.clone();
        b.iter(|| {
            saved.clone_from(black_box(&testbed));
            testbed.clone_from(black_box(&saved));
        });
    });
}

criterion_group!(benches, parts);
criterion_main!(benches);
