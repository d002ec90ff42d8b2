//! What real masters do outside the standard, or at its edges, and what works all the same.

use crate::modes::{INTERFACES, in_mode};
use crate::support::{Arguments, Fmu, Status};
use fmi2_export::Interface::{CoSimulation, ModelExchange};
use fmi2_export::call_table::Mode::*;
use prw_testbed::variables::vr;

/// OpenModelica and libcosim set inputs before fmi2SetupExperiment; they count at the initialization.
#[test]
fn inputs_before_the_initialization() {
    for interface in INTERFACES {
        let fmu = in_mode(interface, Instantiated);
        fmu.set(&[vr::theta1, vr::theta2, vr::omega1, vr::omega2], &[0.1, 0.2, 0.3, 0.4]);
        fmu.initialize(0.0);
        assert_eq!(fmu.get([vr::theta1, vr::theta2, vr::omega1, vr::omega2]), [0.1, 0.2, 0.3, 0.4]);
    }
}

/// The standard forbids it in Co-Simulation (section 4.2.4), OMSimulator does it at every step. States
/// and outputs wait for the step, torques follow the input at once.
#[test]
fn get_after_set_without_a_step() {
    let fmu = in_mode(CoSimulation, StepComplete);
    fmu.step(0.0, 0.01);
    let before = fmu.get([vr::pitch, vr::theta3, vr::tau1]);
    fmu.set(&[vr::theta1], &[0.1]);
    let [theta1, pitch, theta3, tau1] = fmu.get([vr::theta1, vr::pitch, vr::theta3, vr::tau1]);
    assert_eq!([theta1, pitch, theta3], [0.1, before[0], before[1]]);
    assert_ne!(tau1, before[2]);
}

/// OpenModelica sets fixed parameters after the initialization, users tune while the simulation runs;
/// the next values are those of the new parameters.
#[test]
fn parameters_after_the_initialization() {
    let torque = |fmu: &Fmu| fmu.get([vr::tau1])[0];
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, Event)] {
        let early = in_mode(interface, Initialization);
        let late = in_mode(interface, mode);
        for fmu in [&early, &late] {
            fmu.set(&[vr::k1, vr::theta1], &[55.0, 0.1]);
            fmu.ok(fmu.fmi2SetInteger(&vr::N, 1, &9));
            fmu.ok(fmu.fmi2SetBoolean(&vr::use_omega, 1, &1));
        }
        early.ok(early.fmi2ExitInitializationMode());
        assert_eq!(torque(&early), torque(&late));
        assert_eq!(early.bytes(), late.bytes());
    }
}

/// FMI Library terminates in a destructor, also after an error.
#[test]
fn terminate_after_an_error() {
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, ContinuousTime)] {
        let fmu = in_mode(interface, mode);
        fmu.refused("an unknown variable", |fmu| fmu.try_set(&[99], &[0.0]));
        fmu.ok(fmu.fmi2Terminate());
        fmu.get([vr::tau1]);
        fmu.ok(fmu.fmi2Reset());
        fmu.initialize(0.0);
    }
}

/// A rejected step can be repeated with better arguments.
#[test]
fn a_step_after_a_refused_one() {
    let fmu = in_mode(CoSimulation, StepComplete);
    fmu.refused("a step backwards", |fmu| fmu.try_step(0.0, -0.1));
    fmu.step(0.0, 0.1);
    fmu.step(0.1, 0.1);
}

/// The communication points of a master: number of the step -> point and step size.
type Clock = fn(i32) -> (f64, f64);

/// Points as masters compute them, each losing the last digits in its own way.
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
        let fmu = Fmu::new(CoSimulation);
        fmu.initialize(clock(0).0);
        for i in 0..STEPS {
            let (point, step_size) = clock(i);
            let status = fmu.try_step(point, step_size);
            assert_eq!(status, Status::Ok, "{label}, step {i}: {:?}", fmu.take_log());
        }
    }
}

#[test]
fn communication_points_that_are_added_up() {
    for step_size in [0.1, 1e-3, 1.0 / 60.0, 1e-6] {
        let fmu = Fmu::new(CoSimulation);
        fmu.initialize(0.0);
        let mut time = 0.0;
        for _ in 0..STEPS {
            fmu.step(time, step_size);
            time += step_size;
        }
    }
}

/// The last step may end beyond the stop time by rounding, in whichever way the master counts.
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
        let fmu = Fmu::new(CoSimulation);
        fmu.enter_initialization(0.0, Some(*stop_time));
        fmu.ok(fmu.fmi2ExitInitializationMode());
        let mut time = 0.0;
        for i in 0..*steps {
            let status = fmu.try_step(time, *step_size);
            assert_eq!(status, Status::Ok, "{label}, step {i}: {:?}", fmu.take_log());
            time += step_size;
        }
        fmu.refused("one step more", |fmu| fmu.try_step(time, *step_size));
    }
}

/// The resource location is not read: whatever it is, the instance is made.
#[test]
fn resource_locations() {
    for resource_location in [
        None,
        Some(c""),
        Some(c"file:///tmp/does%20not%20exist/resources"),
        Some(c"file:/tmp/resources"),
        Some(c"file:////tmp/resources"),
        Some(c"file://localhost/tmp/resources"),
        Some(c"file:///C:/temp/MyFMU/resources"),
        Some(c"/tmp/no scheme at all"),
        Some(c"fmi2://elsewhere/100%"),
    ] {
        let arguments = Arguments { resource_location, ..Arguments::new(CoSimulation) };
        let fmu = Fmu::instantiate(&arguments).unwrap_or_else(|log| panic!("{resource_location:?}: {log:?}"));
        fmu.initialize(0.0);
        assert_eq!(fmu.take_log(), []);
    }
}

/// NULL as logger silences the FMU, nothing more. (NULL as memory callbacks is what all tests pass.)
#[test]
fn no_logger() {
    let fmu =
        Fmu::instantiate(&Arguments { logger: false, logging_on: true, ..Arguments::new(ModelExchange) })
            .unwrap();
    fmu.initialize(0.0);
    assert_eq!(fmu.try_set(&[99], &[0.0]), Status::Error);
    assert_eq!(fmu.take_log(), []);
}
