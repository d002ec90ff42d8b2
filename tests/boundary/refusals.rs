//! Calls that make no sense are refused: `fmi2Error`, one message that says what is wrong, and nothing
//! changed. [`Fmu::refused`] checks all that; the tables here say what is tried and what the message
//! must tell.

use crate::modes::{INTERFACES, in_mode};
use crate::support::{Arguments, Fmu, Status, assert_clean};
use fmi2_export::Interface::{CoSimulation, ModelExchange};
use fmi2_export::call_table::Mode::*;
use prw_testbed::variables::{VARIABLES, vr};
use std::ptr::{null, null_mut};

const UNKNOWN: u32 = VARIABLES.len() as u32;
const NAN: f64 = f64::NAN;
const INF: f64 = f64::INFINITY;

/// What is tried, the call, words of the message.
type Case = (&'static str, fn(&Fmu) -> Status, &'static [&'static str]);

#[track_caller]
fn all_refused(fmu: &Fmu, cases: &[Case]) {
    for (label, call, words) in cases {
        let message = fmu.refused(label, call);
        for word in *words {
            assert!(message.contains(word), "{label}: '{word}' is not in: {message}");
        }
    }
}

/// Value references and arrays, the same for both interface types and all modes with getters and
/// setters.
const ARRAYS: &[Case] = &[
    ("get, unknown", |fmu| fmu.fmi2GetReal(&UNKNOWN, 1, &mut 0.0), &["value reference 33"]),
    ("get, unknown, last", |fmu| fmu.fmi2GetReal(&u32::MAX, 1, &mut 0.0), &["4294967295"]),
    ("get, one of three", |fmu| fmu.fmi2GetReal([0, 99, 1].as_ptr(), 3, [0.0; 3].as_mut_ptr()), &["99"]),
    ("get Real of an Integer", |fmu| fmu.fmi2GetReal(&vr::M, 1, &mut 0.0), &["M is of type Integer", "Real"]),
    ("get Real of a Boolean", |fmu| fmu.fmi2GetReal(&vr::use_omega, 1, &mut 0.0), &["use_omega", "Boolean"]),
    ("get Integer of a Real", |fmu| fmu.fmi2GetInteger(&vr::tau1, 1, &mut 0), &["tau1", "Real", "Integer"]),
    ("get Integer, unknown", |fmu| fmu.fmi2GetInteger(&UNKNOWN, 1, &mut 0), &["33"]),
    ("get Boolean of an Integer", |fmu| fmu.fmi2GetBoolean(&vr::N, 1, &mut 0), &["N", "Integer", "Boolean"]),
    ("get String of a Real", |fmu| fmu.fmi2GetString(&vr::roll, 1, &mut null()), &["roll", "Real", "String"]),
    ("get String, unknown", |fmu| fmu.fmi2GetString(&UNKNOWN, 1, &mut null()), &["33"]),
    ("set, unknown", |fmu| fmu.try_set(&[UNKNOWN], &[0.0]), &["33"]),
    ("set, last of two", |fmu| fmu.try_set(&[vr::theta1, 99], &[0.1, 0.2]), &["99"]),
    ("set Real of an Integer", |fmu| fmu.try_set(&[vr::N], &[7.0]), &["N is of type Integer"]),
    ("set Integer of a Real", |fmu| fmu.fmi2SetInteger(&vr::k1, 1, &1), &["k1 is of type Real"]),
    ("set Boolean of an Integer", |fmu| fmu.fmi2SetBoolean(&vr::M, 1, &1), &["M is of type Integer"]),
    ("set String of a Boolean", |fmu| fmu.fmi2SetString(&vr::use_omega, 1, &c"1".as_ptr()), &["use_omega"]),
    ("set calculated", |fmu| fmu.try_set(&[vr::pitch], &[0.0]), &["pitch cannot be set"]),
    ("set NaN", |fmu| fmu.try_set(&[vr::theta1, vr::theta2], &[0.1, NAN]), &["theta2", "finite"]),
    ("set infinity", |fmu| fmu.try_set(&[vr::omega1], &[INF]), &["omega1", "finite", "inf"]),
    ("set -infinity", |fmu| fmu.try_set(&[vr::omega2], &[-INF]), &["omega2", "-inf"]),
    ("get, NULL vr", |fmu| fmu.fmi2GetReal(null(), 1, &mut 0.0), &["vr", "NULL"]),
    ("get, NULL values", |fmu| fmu.fmi2GetReal(&vr::tau1, 1, null_mut()), &["value", "NULL"]),
    ("get, beyond memory", |fmu| fmu.fmi2GetReal(&0, usize::MAX, &mut 0.0), &["larger than memory"]),
    ("get Integer, NULL", |fmu| fmu.fmi2GetInteger(&vr::M, 1, null_mut()), &["NULL"]),
    ("get Boolean, NULL", |fmu| fmu.fmi2GetBoolean(null(), 2, &mut 0), &["NULL", "2"]),
    ("get String, NULL", |fmu| fmu.fmi2GetString(null(), 1, &mut null()), &["NULL"]),
    ("set, NULL vr", |fmu| fmu.fmi2SetReal(null(), 1, &0.0), &["vr", "NULL"]),
    ("set, NULL values", |fmu| fmu.fmi2SetReal(&vr::theta1, 1, null()), &["value", "NULL"]),
    ("set Integer, NULL", |fmu| fmu.fmi2SetInteger(&vr::M, 1, null()), &["NULL"]),
    ("set Boolean, NULL", |fmu| fmu.fmi2SetBoolean(null(), 1, &1), &["NULL"]),
    ("set String, NULL", |fmu| fmu.fmi2SetString(null(), 1, null()), &["NULL"]),
];

#[test]
fn value_references_and_arrays() {
    for interface in INTERFACES {
        all_refused(&in_mode(interface, Initialization), ARRAYS);
    }
    all_refused(&in_mode(CoSimulation, StepComplete), ARRAYS);
    all_refused(&in_mode(ModelExchange, Event), ARRAYS);
}

#[test]
fn empty_arrays_are_fine() {
    let fmu = in_mode(CoSimulation, Initialization);
    fmu.ok(fmu.fmi2GetReal(null(), 0, null_mut()));
    fmu.ok(fmu.fmi2SetInteger(null(), 0, null()));
    fmu.ok(fmu.fmi2SetString(null(), 0, null()));
    fmu.ok(fmu.fmi2GetDirectionalDerivative(null(), 0, null(), 0, null(), null_mut()));
    fmu.ok(fmu.fmi2SetRealInputDerivatives(null(), 0, null(), null()));
}

/// Parameters out of their range, with what the message must tell.
const PARAMETERS: &[Case] = &[
    ("J2 = 0", |fmu| fmu.try_set(&[vr::J2], &[0.0]), &["J2", "> 0"]),
    ("J3 < 0", |fmu| fmu.try_set(&[vr::J3], &[-0.1]), &["J3", "-0.1"]),
    ("H3 = -0", |fmu| fmu.try_set(&[vr::H3], &[-0.0]), &["H3"]),
    ("k1 = 0", |fmu| fmu.try_set(&[vr::k1], &[0.0]), &["k1", "> 0"]),
    ("k2 < 0", |fmu| fmu.try_set(&[vr::k2], &[-1e-300]), &["k2"]),
    ("c1 < 0", |fmu| fmu.try_set(&[vr::c1], &[-1.0]), &["c1", "0", "-1"]),
    ("c2 < 0", |fmu| fmu.try_set(&[vr::c2], &[-1.0]), &["c2"]),
    ("c3 < 0", |fmu| fmu.try_set(&[vr::c3], &[-1.0]), &["c3"]),
    ("c1 = c2 = 0", |fmu| fmu.try_set(&[vr::c1, vr::c2], &[0.0, 0.0]), &["c1 and c2"]),
    ("k1 NaN", |fmu| fmu.try_set(&[vr::k1], &[NAN]), &["k1", "finite"]),
    ("J2 good, J3 bad", |fmu| fmu.try_set(&[vr::J2, vr::J3], &[0.1, -1.0]), &["J3"]),
    ("theta1 good, k1 bad", |fmu| fmu.try_set(&[vr::theta1, vr::k1], &[0.1, 0.0]), &["k1"]),
    (
        "too far apart",
        |fmu| fmu.try_set(&[vr::k1, vr::c1, vr::c2], &[1e300, 1e-300, 0.0]),
        &["too far apart"],
    ),
    ("M = 0", |fmu| fmu.fmi2SetInteger(&vr::M, 1, &0), &["M", "1", "0"]),
    ("N < 0", |fmu| fmu.fmi2SetInteger(&vr::N, 1, &-7), &["N", "-7"]),
    ("N good, M bad", |fmu| fmu.fmi2SetInteger([vr::N, vr::M].as_ptr(), 2, [9, 0].as_ptr()), &["M"]),
    ("use_omega = 2", |fmu| fmu.fmi2SetBoolean(&vr::use_omega, 1, &2), &["use_omega", "2"]),
    ("use_omega = -1", |fmu| fmu.fmi2SetBoolean(&vr::use_omega, 1, &-1), &["use_omega", "-1"]),
];

#[test]
fn parameters_out_of_range() {
    for interface in INTERFACES {
        all_refused(&in_mode(interface, Instantiated), PARAMETERS);
        all_refused(&in_mode(interface, Initialization), PARAMETERS);
    }
    all_refused(&in_mode(CoSimulation, StepComplete), PARAMETERS);
}

/// One of the dampings may be 0, in either order of setting them.
#[test]
fn one_damping_may_be_zero() {
    let fmu = in_mode(CoSimulation, Instantiated);
    for (zero, other) in [(vr::c1, vr::c2), (vr::c2, vr::c1)] {
        fmu.set(&[zero], &[0.0]);
        let message = fmu.refused("the other damping too", |fmu| fmu.try_set(&[other], &[0.0]));
        assert!(message.contains("c1 and c2"), "{message}");
        fmu.set(&[zero], &[0.1]);
    }
}

#[test]
fn experiments() {
    let setup = |defined, tolerance, start, stop_defined, stop| {
        move |fmu: &Fmu| fmu.fmi2SetupExperiment(defined, tolerance, start, stop_defined, stop)
    };
    for interface in INTERFACES {
        let fmu = in_mode(interface, Instantiated);
        for (label, call, word) in [
            ("tolerance NaN", setup(1, NAN, 0.0, 0, 0.0), "tolerance"),
            ("tolerance < 0", setup(1, -1e-6, 0.0, 0, 0.0), "tolerance"),
            ("start NaN", setup(0, 0.0, NAN, 0, 0.0), "startTime"),
            ("start infinite", setup(0, 0.0, -INF, 0, 0.0), "startTime"),
            ("stop before start", setup(0, 0.0, 1.0, 1, 0.5), "stopTime"),
            ("stop NaN", setup(0, 0.0, 0.0, 1, NAN), "stopTime"),
        ] {
            let message = fmu.refused(label, call);
            assert!(message.contains(word), "{message}");
        }
        // What is not defined is not looked at, and a tolerance of 0 is none.
        fmu.ok(setup(0, NAN, 0.0, 0, NAN)(&fmu));
        fmu.ok(setup(1, 0.0, 0.0, 1, 0.0)(&fmu));
    }
}

#[test]
fn steps() {
    let fmu = Fmu::new(CoSimulation);
    fmu.enter_initialization(1.0, Some(2.0));
    fmu.ok(fmu.fmi2ExitInitializationMode());
    fmu.step(1.0, 0.25);
    for (label, point, step_size, word) in [
        ("no step", 1.25, 0.0, "step size"),
        ("negative zero", 1.25, -0.0, "step size"),
        ("backwards", 1.25, -0.25, "step size"),
        ("NaN step", 1.25, NAN, "step size"),
        ("infinite step", 1.25, INF, "step size"),
        ("vanishing step", 1.25, 1e-17, "vanishes"),
        ("NaN point", NAN, 0.25, "point"),
        ("infinite point", INF, 0.25, "point"),
        ("point before", 1.0, 0.25, "1.25"),
        ("point after", 1.5, 0.25, "1.25"),
        ("point slightly off", 1.25 + 1e-6, 0.25, "1.25"),
        ("past the stop time", 1.25, 0.76, "stop time 2"),
        ("far past the stop time", 1.25, 1e300, "stop time 2"),
    ] {
        let message = fmu.refused(label, |fmu| fmu.try_step(point, step_size));
        assert!(message.contains(word), "{label}: {message}");
    }
    fmu.step(1.25, 0.75);
}

/// A step to infinity is refused, and everything stays usable.
#[test]
fn steps_out_of_the_range_of_numbers() {
    let fmu = in_mode(CoSimulation, StepComplete);
    fmu.set(&[vr::theta1], &[f64::MAX]);
    fmu.set_rates([vr::theta1], [f64::MAX]);
    let message = fmu.refused("a step to infinity", |fmu| fmu.try_step(0.0, 10.0));
    assert!(message.contains("range of numbers"), "{message}");
    let message = fmu.refused("an infinite torque", |fmu| fmu.fmi2GetReal(&vr::tau1, 1, &mut 0.0));
    assert!(message.contains("tau1"), "{message}");
    fmu.set(&[vr::theta1], &[0.1]);
    fmu.set_rates([vr::theta1], [0.0]);
    fmu.step(0.0, 10.0);
}

/// The parabola through the samples may have an end in range and a rate there that is not: the next state
/// could not be saved.
#[test]
fn motors_out_of_the_range_of_numbers() {
    let fmu = in_mode(CoSimulation, StepComplete);
    let h = 1.0 / 1024.0;
    fmu.step(0.0, h);
    fmu.step(h, h);
    fmu.set(&[vr::theta1], &[1e302]);
    let message = fmu.refused("a motor of infinite rate", |fmu| fmu.try_step(2.0 * h, 10.0));
    assert!(message.contains("range of numbers"), "{message}");
    fmu.restore(&fmu.bytes());
    fmu.step(2.0 * h, h);
    fmu.restore(&fmu.bytes());
}

/// Masters that wait for long take long steps. However long, an answer comes at once.
#[test]
fn steps_of_any_size() {
    for step_size in [1e-300, 1e-9, 1.0, 1e9, 1e100, 1e300, 0.5 * f64::MAX] {
        let (answer, answers) = std::sync::mpsc::channel();
        std::thread::spawn(move || {
            let fmu = in_mode(CoSimulation, StepComplete);
            fmu.set(&[vr::theta1, vr::theta2], &[0.5, 0.5]);
            let _ = answer.send((fmu.try_step(0.0, step_size), fmu.get([vr::pitch])));
        });
        let (status, [pitch]) = answers
            .recv_timeout(std::time::Duration::from_secs(10))
            .unwrap_or_else(|_| panic!("a step of {step_size:e} s takes for ever"));
        assert!(matches!(status, Status::Ok | Status::Error), "{step_size:e}: {status:?}");
        if status == Status::Ok && step_size >= 10.0 {
            assert!((pitch - 0.5).abs() < 1e-12, "{step_size:e}: {pitch}");
        }
    }
}

const DERIVATIVES: &[Case] = &[
    ("order 0", |fmu| fmu.fmi2SetRealInputDerivatives(&vr::theta1, 1, &0, &0.0), &["theta1", "order", "0"]),
    ("order -1", |fmu| fmu.fmi2SetRealInputDerivatives(&vr::theta1, 1, &-1, &0.0), &["theta1", "-1"]),
    ("NaN", |fmu| fmu.fmi2SetRealInputDerivatives(&vr::theta2, 1, &1, &NAN), &["theta2", "finite"]),
    ("NaN of order 3", |fmu| fmu.fmi2SetRealInputDerivatives(&vr::theta2, 1, &3, &INF), &["theta2"]),
    ("of an output", |fmu| fmu.fmi2SetRealInputDerivatives(&vr::tau1, 1, &1, &0.0), &["tau1", "input"]),
    ("of a parameter", |fmu| fmu.fmi2SetRealInputDerivatives(&vr::k1, 1, &1, &0.0), &["k1", "input"]),
    ("of an Integer", |fmu| fmu.fmi2SetRealInputDerivatives(&vr::M, 1, &1, &0.0), &["M", "Integer"]),
    ("of nothing", |fmu| fmu.fmi2SetRealInputDerivatives(&UNKNOWN, 1, &1, &0.0), &["33"]),
    (
        "good and bad",
        |fmu| fmu.fmi2SetRealInputDerivatives([0, 1].as_ptr(), 2, [1, 0].as_ptr(), [0.5; 2].as_ptr()),
        &["theta2"],
    ),
    ("NULL vr", |fmu| fmu.fmi2SetRealInputDerivatives(null(), 1, &1, &0.0), &["vr", "NULL"]),
    ("NULL order", |fmu| fmu.fmi2SetRealInputDerivatives(&0, 1, null(), &0.0), &["order", "NULL"]),
    ("NULL value", |fmu| fmu.fmi2SetRealInputDerivatives(&0, 1, &1, null()), &["value", "NULL"]),
    (
        "output, order 0",
        |fmu| fmu.fmi2GetRealOutputDerivatives(&vr::tau1, 1, &0, &mut 0.0),
        &["tau1", "order"],
    ),
    (
        "output, order -2",
        |fmu| fmu.fmi2GetRealOutputDerivatives(&vr::roll, 1, &-2, &mut 0.0),
        &["roll", "-2"],
    ),
    ("output, Integer", |fmu| fmu.fmi2GetRealOutputDerivatives(&vr::N, 1, &1, &mut 0.0), &["N", "Integer"]),
    ("output, nothing", |fmu| fmu.fmi2GetRealOutputDerivatives(&UNKNOWN, 1, &1, &mut 0.0), &["33"]),
    (
        "output, NULL",
        |fmu| fmu.fmi2GetRealOutputDerivatives(&vr::tau1, 1, &1, null_mut()),
        &["value", "NULL"],
    ),
    (
        "output, NULL order",
        |fmu| fmu.fmi2GetRealOutputDerivatives(&0, 1, null(), &mut 0.0),
        &["order", "NULL"],
    ),
];

#[test]
fn derivatives_with_respect_to_time() {
    all_refused(&in_mode(CoSimulation, StepComplete), DERIVATIVES);
}

fn directional(fmu: &Fmu, unknown: u32, known: u32, seed: f64) -> Status {
    fmu.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &seed, &mut 0.0)
}

const DIRECTIONAL: &[Case] = &[
    ("of an input", |fmu| directional(fmu, vr::theta1, vr::theta2, 1.0), &["theta1", "unknown"]),
    ("of a parameter", |fmu| directional(fmu, vr::k1, vr::theta2, 1.0), &["k1", "unknown"]),
    ("of a local state", |fmu| directional(fmu, vr::theta5, vr::theta2, 1.0), &["theta5", "unknown"]),
    ("with respect to an output", |fmu| directional(fmu, vr::tau1, vr::roll, 1.0), &["roll", "known"]),
    ("with respect to a derivative", |fmu| directional(fmu, vr::tau1, vr::der_theta3, 1.0), &["der(theta3)"]),
    ("with respect to an Integer", |fmu| directional(fmu, vr::tau1, vr::M, 1.0), &["M", "Integer"]),
    ("of nothing", |fmu| directional(fmu, UNKNOWN, vr::theta1, 1.0), &["33"]),
    ("with respect to nothing", |fmu| directional(fmu, vr::tau1, UNKNOWN, 1.0), &["33"]),
    ("along NaN", |fmu| directional(fmu, vr::tau1, vr::theta1, NAN), &["theta1", "seed"]),
    (
        "NULL seed",
        |fmu| fmu.fmi2GetDirectionalDerivative(&vr::tau1, 1, &vr::theta1, 1, null(), &mut 0.0),
        &["dvKnown", "NULL"],
    ),
    (
        "NULL result",
        |fmu| fmu.fmi2GetDirectionalDerivative(&vr::tau1, 1, &vr::theta1, 1, &1.0, null_mut()),
        &["dvUnknown", "NULL"],
    ),
    (
        "NULL knowns",
        |fmu| fmu.fmi2GetDirectionalDerivative(&vr::tau1, 1, null(), 1, &1.0, &mut 0.0),
        &["vKnown_ref", "NULL"],
    ),
    (
        "NULL unknowns",
        |fmu| fmu.fmi2GetDirectionalDerivative(null(), 2, &vr::theta1, 1, &1.0, &mut 0.0),
        &["vUnknown_ref", "NULL"],
    ),
];

#[test]
fn directional_derivatives() {
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, ContinuousTime)] {
        let fmu = in_mode(interface, mode);
        all_refused(&fmu, DIRECTIONAL);
        let message = fmu.refused("parameter", |fmu| directional(fmu, vr::tau1, vr::k1, 1.0));
        assert!(message.contains("k1 is no known"), "{message}");
    }
}

const STATES: &[Case] = &[
    ("five states", |fmu| fmu.fmi2SetContinuousStates([0.1; 5].as_ptr(), 5), &["6", "5"]),
    ("seven states", |fmu| fmu.fmi2SetContinuousStates([0.1; 7].as_ptr(), 7), &["6", "7"]),
    ("no states", |fmu| fmu.fmi2SetContinuousStates(null(), 0), &["6", "0"]),
    ("NULL states", |fmu| fmu.fmi2SetContinuousStates(null(), 6), &["NULL"]),
    (
        "last state NaN",
        |fmu| fmu.fmi2SetContinuousStates([0.1, 0.1, 0.1, 0.1, 0.1, NAN].as_ptr(), 6),
        &["omega6", "finite"],
    ),
    ("infinite state", |fmu| fmu.try_set(&[vr::theta5], &[INF]), &["theta5"]),
    ("get five", |fmu| fmu.fmi2GetContinuousStates([0.0; 5].as_mut_ptr(), 5), &["6", "5"]),
    ("get into NULL", |fmu| fmu.fmi2GetContinuousStates(null_mut(), 6), &["NULL"]),
    ("seven derivatives", |fmu| fmu.fmi2GetDerivatives([0.0; 7].as_mut_ptr(), 7), &["6", "7"]),
    ("derivatives into NULL", |fmu| fmu.fmi2GetDerivatives(null_mut(), 6), &["NULL"]),
    ("five nominals", |fmu| fmu.fmi2GetNominalsOfContinuousStates([0.0; 5].as_mut_ptr(), 5), &["6", "5"]),
    ("nominals into NULL", |fmu| fmu.fmi2GetNominalsOfContinuousStates(null_mut(), 6), &["NULL"]),
    ("one event indicator", |fmu| fmu.fmi2GetEventIndicators(&mut 0.0, 1), &["no event indicators"]),
    ("time NaN", |fmu| fmu.fmi2SetTime(NAN), &["time", "finite"]),
    ("time infinite", |fmu| fmu.fmi2SetTime(INF), &["time", "finite"]),
    ("step ends in NULL", |fmu| fmu.fmi2CompletedIntegratorStep(1, null_mut(), &mut 0), &["enterEventMode"]),
    (
        "step ends in NULL, 2",
        |fmu| fmu.fmi2CompletedIntegratorStep(1, &mut 0, null_mut()),
        &["terminateSimulation"],
    ),
];

#[test]
fn continuous_states() {
    all_refused(&in_mode(ModelExchange, ContinuousTime), STATES);
    let message =
        in_mode(ModelExchange, Event).refused("no event info", |fmu| fmu.fmi2NewDiscreteStates(null_mut()));
    assert!(message.contains("NULL"), "{message}");
}

#[test]
fn status_kinds() {
    let fmu = in_mode(CoSimulation, StepComplete);
    for kind in [-1, 4, i32::MAX] {
        fmu.refused("GetStatus", |fmu| fmu.fmi2GetStatus(kind, &mut Status::Ok));
        fmu.refused("GetRealStatus", |fmu| fmu.fmi2GetRealStatus(kind, &mut 0.0));
        fmu.refused("GetIntegerStatus", |fmu| fmu.fmi2GetIntegerStatus(kind, &mut 0));
        fmu.refused("GetBooleanStatus", |fmu| fmu.fmi2GetBooleanStatus(kind, &mut 0));
        fmu.refused("GetStringStatus", |fmu| fmu.fmi2GetStringStatus(kind, &mut null()));
    }
    fmu.refused("NULL", |fmu| fmu.fmi2GetRealStatus(2, null_mut()));
    fmu.refused("NULL", |fmu| fmu.fmi2GetBooleanStatus(3, null_mut()));

    fmu.step(0.0, 0.25);
    let (mut time, mut terminated) = (0.0, -1);
    fmu.ok(fmu.fmi2GetRealStatus(2, &mut time));
    fmu.ok(fmu.fmi2GetBooleanStatus(3, &mut terminated));
    assert_eq!((time, terminated), (0.25, 0));
}

/// What is wrong with the arguments, and words of the message.
#[test]
fn instantiation() {
    type Change = fn(&mut Arguments<'static>);
    let cases: &[(&str, Change, &[&str])] = &[
        ("no name", |a| a.instance_name = None, &["name"]),
        ("empty name", |a| a.instance_name = Some(c""), &["name"]),
        ("blank name", |a| a.instance_name = Some(c" \t "), &["name"]),
        ("no guid", |a| a.guid = None, &["guid", "NULL"]),
        ("empty guid", |a| a.guid = Some(c""), &["guid"]),
        ("wrong guid", |a| a.guid = Some(c"{1%s-#r1#}"), &["guid", "{1_s-_r1_}", crate::GUID_TEXT]),
        ("fmuType 2", |a| a.fmu_type = 2, &["fmuType", "2"]),
        ("fmuType -1", |a| a.fmu_type = -1, &["fmuType", "-1"]),
    ];
    for (label, change, words) in cases {
        let mut arguments = Arguments::new(CoSimulation);
        change(&mut arguments);
        let Err(log) = Fmu::instantiate(&arguments) else { panic!("{label} is accepted") };
        let [message] = log.as_slice() else { panic!("{label}: one message expected, not {log:?}") };
        assert_clean(message);
        assert_eq!((message.status, message.category.as_str()), (Status::Error, "logStatusError"), "{label}");
        assert!(message.text.starts_with("fmi2Instantiate: "), "{label}: {}", message.text);
        for word in *words {
            assert!(message.text.contains(word), "{label}: '{word}' is not in: {}", message.text);
        }
        // Without anyone to tell it is refused all the same.
        arguments.logger = false;
        assert!(Fmu::instantiate(&arguments).is_err_and(|log| log.is_empty()), "{label}, silently");
    }
    assert!(Fmu::instantiate(&Arguments { callbacks: false, ..Arguments::new(CoSimulation) }).is_err());
}

/// An instance name that is no UTF-8 is still a name.
#[test]
fn odd_instance_names() {
    let arguments =
        Arguments { instance_name: Some(c"wr\xffst %d #"), logger: false, ..Arguments::new(CoSimulation) };
    assert!(Fmu::instantiate(&arguments).is_ok());
}
