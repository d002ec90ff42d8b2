//! Unusual calls of real importers that must work although the standard forbids them or leaves them open.

use crate::models::{Counter, Oscillator, Palette, counter, oscillator::Name};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::Status;
use fmu_test_kit::{Either, Importer, fmi3};
use std::ops::Range;

const FORCE: u32 = Name::force as u32;
const ACCELERATION: u32 = Name::der_velocity as u32;

/// Checks that parameters can be set after the initialization and take effect immediately. OpenModelica sets fixed
/// parameters then, and users tune parameters during the simulation.
#[test]
fn parameters_after_the_initialization() {
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, Event)] {
        let early = Importer::in_mode::<Oscillator>(interface, Initialization);
        let late = Importer::in_mode::<Oscillator>(interface, mode);
        for fmu in [&early, &late] {
            fmu.set(&[Name::mass as u32, FORCE], &[4.0, 0.1]);
            fmu.ok(fmu.set_integer(Name::springs as u32, 2));
            fmu.ok(fmu.set_boolean(Name::damped as u32, 0));
        }
        early.ok(early.fmi2ExitInitializationMode());
        assert_eq!(early.get([ACCELERATION]), late.get([ACCELERATION]));
        assert_eq!(early.bytes(), late.bytes());
    }
}

/// Checks that a discrete input may be set to its current value in Continuous-Time Mode, because FMPy does this if an FMU
/// has an event indicator. Any other value would need an event, so the call is rejected.
fn unchanged_discrete_inputs<F: Either>() {
    use counter::Name::{increment, paused, weight};
    let fmu = F::in_mode::<Counter>(ModelExchange, ContinuousTime);
    let before = fmu.bytes();
    fmu.ok(fmu.set_integer(increment as u32, 1));
    fmu.ok(fmu.set_boolean(paused as u32, 0));
    fmu.ok(fmu.try_set(&[weight as u32], &[1.0]));
    assert_eq!(fmu.bytes(), before);
    fmu.rejected("another Integer", |fmu| fmu.set_integer(increment as u32, 2));
    fmu.rejected("another Boolean", |fmu| fmu.set_boolean(paused as u32, 1));
    fmu.rejected("another Real", |fmu| fmu.try_set(&[weight as u32], &[1.5]));
    let output = counter::Name::count as u32;
    fmu.rejected("an output", |fmu| fmu.set_integer(output, 0));
}

#[test]
fn discrete_inputs_that_do_not_change() {
    unchanged_discrete_inputs::<Importer>();
    unchanged_discrete_inputs::<fmi3::Importer>();
}

/// Checks that Configuration Mode can be entered without structural parameters, because FMIKit enters it in every FMU for
/// FMI 3.0 that has inputs.
#[test]
fn configuration_without_structural_parameters() {
    for interface in [CoSimulation, ModelExchange] {
        let fmu = fmi3::Importer::new::<Oscillator>(interface);
        let before = fmu.bytes();
        fmu.ok(fmu.fmi3EnterConfigurationMode());
        fmu.set(&[Name::mass as u32], &[2.0]);
        fmu.ok(fmu.fmi3ExitConfigurationMode());
        assert_eq!(fmu.bytes(), before);
        fmu.initialize(0.0);
        fmu.rejected("too late", |fmu| fmu.fmi3ExitConfigurationMode());
    }
}

/// A function that returns the communication point and the step size of the step with this number.
type Clock = fn(i32) -> (f64, f64);

/// Communication points as importers compute them, with different rounding errors.
const CLOCKS: &[(&str, Clock)] = &[
    ("multiplied, 1 ms", |i| (f64::from(i) * 1e-3, 1e-3)),
    ("differences of multiplied times, 0.1 s", |i| {
        (f64::from(i) * 0.1, f64::from(i + 1) * 0.1 - f64::from(i) * 0.1)
    }),
    ("multiplied, 0.1 microseconds", |i| (f64::from(i) * 1e-7, 1e-7)),
    ("60 Hz, exact step, points in nanoseconds", |i| {
        ((f64::from(i) * 1e9 / 60.0).round() * 1e-9, 1.0 / 60.0)
    }),
    ("60 Hz, exact step, points cut to nanoseconds", |i| {
        ((f64::from(i) * 1e9 / 60.0).floor() / 1e9, 1.0 / 60.0)
    }),
    ("60 Hz, all in nanoseconds", |i| {
        let nanoseconds = |i| (i64::from(i) * 1_000_000_000 + 30) / 60;
        (nanoseconds(i) as f64 * 1e-9, (nanoseconds(i + 1) - nanoseconds(i)) as f64 * 1e-9)
    }),
    ("1024 Hz in nanoseconds, exact step", |i| ((f64::from(i) * 1e9 / 1024.0).trunc() * 1e-9, 1.0 / 1024.0)),
    ("off by 3e-12", |i| (f64::from(i) * 1e-3 + f64::from(i % 3 - 1) * 3e-12, 1e-3)),
    ("late start", |i| (86_400.0 + f64::from(i) * 1e-3, 1e-3)),
    ("negative start", |i| (-40.0 + f64::from(i) * 1e-3, 1e-3)),
    ("1 kHz since 1970", |i| (1.7e9 + f64::from(i) * 1e-3, 1e-3)),
];

const STEPS: i32 = 100_000;

#[test]
fn communication_points_off_by_rounding() {
    for (label, clock) in CLOCKS {
        let fmu = Importer::initialized_at::<Oscillator>(clock(0).0);
        for i in 0..STEPS {
            let (point, step_size) = clock(i);
            let status = fmu.try_step(point, step_size);
            assert_eq!(status, Status::Ok, "{label}, step {i}: {:?}", fmu.take_log());
        }
    }
}

/// Checks that the last step may exceed the stop time by a rounding error.
#[test]
fn stop_time_passed_by_rounding() {
    let cases: &[(&str, f64, i32, f64)] = &[
        // label, step size, steps, stop time
        ("0.1 + 0.1 + 0.1 > 0.3", 0.1, 3, 0.3),
        ("60 Hz in nanoseconds", 16_666_667e-9, 60, 1.0),
        ("ten seconds of 1 ms", 1e-3, 10_000, 10.0),
        ("thirds", 1.0 / 3.0, 9, 3.0),
    ];
    for (label, step_size, steps, stop_time) in cases {
        let fmu = Importer::new::<Oscillator>(CoSimulation);
        fmu.enter_initialization(0.0, Some(*stop_time));
        fmu.ok(fmu.fmi2ExitInitializationMode());
        let mut time = 0.0;
        for i in 0..*steps {
            let status = fmu.try_step(time, *step_size);
            assert_eq!(status, Status::Ok, "{label}, step {i}: {:?}", fmu.take_log());
            time += step_size;
        }
        fmu.rejected("one step more", |fmu| fmu.try_step(time, *step_size));
    }
}

const H: f64 = 1e-3;

/// Performs steps of 1 ms with two importers: one calculates its time as `step * H`, the other adds `H` to `sum` in each
/// step. Both must be accepted, and the times of the FMUs must equal the times of their importers exactly. Returns the
/// final time of the adding importer.
fn run<F: Either>(range: Range<u64>, mut sum: f64) -> f64 {
    let multiplying = F::initialized_at::<Palette>(range.start as f64 * H);
    let adding = F::initialized_at::<Palette>(sum);
    for step in range {
        multiplying.step(step as f64 * H, H);
        adding.step(sum, H);
        sum += H;
    }
    sum
}

const MANY_STEPS: u64 = 100_000_000;

/// Returns the time of an adding importer after this number of steps.
fn added_up(steps: u64) -> f64 {
    (0..steps).fold(0.0, |sum, _| sum + H)
}

/// Checks that the time of an instance does not drift from the importer's time. After a step, the time is the importer's
/// point plus the step size, and the next point may differ by a rounding error. Therefore it suffices to test some of the
/// 10^8 steps: the first ones and, with the accumulated time of an adding importer, the last ones.
#[test]
fn time_does_not_drift() {
    let first = MANY_STEPS - 10_000;
    let sum = added_up(first);
    run::<Importer>(0..50_000, 0.0);
    run::<Importer>(first..MANY_STEPS, sum);
    run::<fmi3::Importer>(0..50_000, 0.0);
    run::<fmi3::Importer>(first..MANY_STEPS, sum);
}

/// Makes all 10^8 steps, which takes seconds in a release build and minutes otherwise.
#[test]
#[ignore = "make sanitize runs it, with optimization"]
fn a_hundred_million_steps() {
    let end = run::<Importer>(0..MANY_STEPS, 0.0);
    assert_eq!(run::<fmi3::Importer>(0..MANY_STEPS, 0.0), end);
    let drift = end - MANY_STEPS as f64 * H;
    println!("adding up ends at {end:?}, {drift:.1e} s off");
    // The times of the two importers differ by much more than the tolerance of 2e-10 s, so an FMU with a separate clock
    // would have rejected the steps of one of them.
    assert!(drift.abs() > 1e-5);
}
