//! Time does not drift, however many steps are taken and however the master counts.

use crate::support::{Fmu, Status};
use fmi2_export::Interface::CoSimulation;
use fmi2_export::types::{fmi2False, fmi2True};
use prw_testbed::variables::vr;
use std::ops::Range;

/// `fmi2LastSuccessfulTime` of section 4.2.3.
const LAST_SUCCESSFUL_TIME: i32 = 2;

const H: f64 = 1e-3;

fn time(fmu: &Fmu) -> f64 {
    let mut time = f64::NAN;
    fmu.ok(fmu.fmi2GetRealStatus(LAST_SUCCESSFUL_TIME, &raw mut time));
    time
}

/// Steps of 1 ms, `range.start * H` being the first point of a master that multiplies, `sum` that of one
/// that adds up. Both must be let through, and the FMU's time is always theirs, to the last bit. Returns
/// where the one that adds up ends.
fn run(range: Range<u64>, mut sum: f64) -> f64 {
    let multiplying = Fmu::new(CoSimulation);
    let adding = Fmu::new(CoSimulation);
    multiplying.initialize(range.start as f64 * H);
    adding.initialize(sum);
    for fmu in [&multiplying, &adding] {
        fmu.ok(fmu.fmi2SetBoolean(&vr::use_omega, 1, &fmi2True));
    }
    for step in range {
        let point = step as f64 * H;
        multiplying.step(point, H);
        adding.step(sum, H);
        sum += H;
        assert_eq!(time(&adding), sum);
        assert_eq!(time(&multiplying), point + H);
    }
    sum
}

const STEPS: u64 = 100_000_000;

/// The clock of a master that adds up, after so many steps.
fn added_up(steps: u64) -> f64 {
    (0..steps).fold(0.0, |sum, _| sum + H)
}

/// The instance keeps no count of its own: the end of a step is the master's point plus the master's step
/// size, and the next point may be off by what rounding can do to it. So the steps on the way to 10^8
/// need not all be made; some at the begin and some at the end are, there also from where a master would
/// be that adds up.
#[test]
fn time_does_not_drift() {
    run(0..50_000, 0.0);
    let first = STEPS - 10_000;
    run(first..STEPS, added_up(first));
}

/// All of them: seconds in a release build, minutes otherwise.
#[test]
#[ignore = "make sanitize runs it, with optimization"]
fn a_hundred_million_steps() {
    let end = run(0..STEPS, 0.0);
    let drift = end - STEPS as f64 * H;
    println!("adding up ends at {end:?}, {drift:.1e} s off");
    // A clock of the FMU's own would have parted from one of the masters: rounding is forgiven up to 2e-10 s.
    assert!(drift.abs() > 1e-5);
}

/// Points that are off by more than rounding are another matter.
#[test]
fn a_point_that_is_really_off_is_refused() {
    let fmu = Fmu::new(CoSimulation);
    fmu.initialize(99_999.0);
    assert_eq!(fmu.fmi2DoStep(99_999.0 + 1e-6, H, fmi2False), Status::Error);
    assert_eq!(fmu.fmi2DoStep(99_999.0 + 1e-11, H, fmi2False), Status::Ok);
}
