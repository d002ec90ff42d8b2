//! Invalid parameters are rejected: one message with the reason, and no change.

use crate::{INTERFACES, in_mode};
use crate::{TABLE, vr};
use fmu_export::Interface::CoSimulation;
use fmu_export::Mode::*;
use fmu_export::{Attributes, Causality, Status};
use fmu_test_kit::{Either, Importer as Fmu, fmi3};
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;

const NAN: f64 = f64::NAN;

/// Label, call, and parts of the message.
type Case = (&'static str, fn(&Fmu) -> Status, &'static [&'static str]);

#[track_caller]
fn all_rejected(fmu: &Fmu, cases: &[Case]) {
    for (label, call, words) in cases {
        let message = fmu.rejected(label, call);
        for word in *words {
            assert!(message.contains(word), "{label}: '{word}' is not in: {message}");
        }
    }
}

/// Parameters out of their range, with parts of the message.
const PARAMETERS: &[Case] = &[
    ("J2 = 0", |fmu| fmu.try_set(&[vr(Name::J2)], &[0.0]), &["J2", "1e-300", "0"]),
    ("J3 < 0", |fmu| fmu.try_set(&[vr(Name::J3)], &[-0.1]), &["J3", "-0.1"]),
    ("H3 = -0", |fmu| fmu.try_set(&[vr(Name::H3)], &[-0.0]), &["H3"]),
    ("k1 = 0", |fmu| fmu.try_set(&[vr(Name::k1)], &[0.0]), &["k1", "1e-300", "0"]),
    ("k2 < 0", |fmu| fmu.try_set(&[vr(Name::k2)], &[-1e-300]), &["k2"]),
    ("c1 < 0", |fmu| fmu.try_set(&[vr(Name::c1)], &[-1.0]), &["c1", "0", "-1"]),
    ("c2 < 0", |fmu| fmu.try_set(&[vr(Name::c2)], &[-1.0]), &["c2"]),
    ("c3 < 0", |fmu| fmu.try_set(&[vr(Name::c3)], &[-1.0]), &["c3"]),
    ("c1 = c2 = 0", |fmu| fmu.try_set(&[vr(Name::c1), vr(Name::c2)], &[0.0, 0.0]), &["c1 and c2"]),
    ("k1 NaN", |fmu| fmu.try_set(&[vr(Name::k1)], &[NAN]), &["k1", "finite"]),
    ("J2 good, J3 bad", |fmu| fmu.try_set(&[vr(Name::J2), vr(Name::J3)], &[0.1, -1.0]), &["J3"]),
    ("theta1 good, k1 bad", |fmu| fmu.try_set(&[vr(Name::theta1), vr(Name::k1)], &[0.1, 0.0]), &["k1"]),
    (
        "too far apart",
        |fmu| fmu.try_set(&[vr(Name::k1), vr(Name::c1), vr(Name::c2)], &[1e300, 1e-300, 0.0]),
        &["too far apart"],
    ),
    ("M = 0", |fmu| fmu.fmi2SetInteger(&vr(Name::M), 1, &0), &["M", "1", "0"]),
    ("N < 0", |fmu| fmu.fmi2SetInteger(&vr(Name::N), 1, &-7), &["N", "-7"]),
    (
        "N good, M bad",
        |fmu| fmu.fmi2SetInteger([vr(Name::N), vr(Name::M)].as_ptr(), 2, [9, 0].as_ptr()),
        &["M"],
    ),
    ("use_omega = 2", |fmu| fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &2), &["use_omega", "2"]),
    ("use_omega = -1", |fmu| fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &-1), &["use_omega", "-1"]),
];

#[test]
fn parameters_out_of_range() {
    for interface in INTERFACES {
        all_rejected(&in_mode(interface, Instantiated), PARAMETERS);
        all_rejected(&in_mode(interface, Initialization), PARAMETERS);
    }
    all_rejected(&in_mode(CoSimulation, StepComplete), PARAMETERS);
}

/// Checks the declared limits: the smallest declared value is accepted and runs; values below it are
/// rejected.
#[test]
fn declared_limits_are_those() {
    let mut found = 0;
    for (index, variable) in (0..).zip(TABLE).filter(|(_, of)| of.causality() == Causality::Parameter) {
        let fmu = in_mode(CoSimulation, Instantiated);
        match variable.variable_type().attributes {
            Attributes::Real { min: Some(min), .. } => {
                let below = if min == 0.0 { -1e-300 } else { 0.999 * min };
                fmu.rejected(variable.name(), |fmu| fmu.try_set(&[index], &[below]));
                fmu.set(&[index], &[min]);
            }
            Attributes::Integer { min, .. } => {
                let min = i32::try_from(min).unwrap();
                fmu.rejected(variable.name(), |fmu| fmu.fmi2SetInteger(&index, 1, &(min - 1)));
                fmu.ok(fmu.fmi2SetInteger(&index, 1, &min));
            }
            _ => continue,
        }
        fmu.initialize(0.0);
        fmu.step(0.0, 0.01);
        fmu.set(&[vr(Name::theta1)], &[0.3]);
        fmu.step(0.01, 0.01);
        let [torque, pitch] = fmu.get([vr(Name::tau1), vr(Name::pitch)]);
        assert!(torque != 0.0 && pitch != 0.0, "{}: {torque} {pitch}", variable.name());
        found += 1;
    }
    assert_eq!(found, 10);
}

/// Checks that one of the dampings may be 0, in either order of setting them.
#[test]
fn one_damping_may_be_zero() {
    let fmu = in_mode(CoSimulation, Instantiated);
    for (zero, other) in [(vr(Name::c1), vr(Name::c2)), (vr(Name::c2), vr(Name::c1))] {
        fmu.set(&[zero], &[0.0]);
        fmu.rejected_with(&["c1 and c2"], |fmu| fmu.try_set(&[other], &[0.0]));
        fmu.set(&[zero], &[0.1]);
    }
}

/// Importers that ignore the status (fmi-sim, OMSimulator) must not run with Table 1 instead. So the
/// initialization fails with the first error message until the parameter has a valid value.
#[test]
fn rejected_parameters_stop_the_initialization() {
    let words = |message: String| message.split_once(": ").unwrap().1.to_owned();
    for interface in INTERFACES {
        for (vr, wrong, right) in [(vr(Name::k1), -1.0, 60.0), (vr(Name::omega5_start), NAN, 0.0)] {
            let fmu = in_mode(interface, Instantiated);
            let first = words(fmu.rejected("a start value", |fmu| fmu.try_set(&[vr], &[wrong])));
            assert_eq!(words(fmu.rejected("to begin", |fmu| fmu.fmi2EnterInitializationMode())), first);
            fmu.set(&[vr], &[right]);
            fmu.enter_initialization(0.0, None);
            let first = words(fmu.rejected("a start value", |fmu| fmu.try_set(&[vr], &[wrong])));
            assert_eq!(words(fmu.rejected("to end", |fmu| fmu.fmi2ExitInitializationMode())), first);
            fmu.set(&[vr], &[right]);
            fmu.ok(fmu.fmi2ExitInitializationMode());

            let fmu = fmi3::Importer::of::<TestbedFmu>(interface);
            let first = words(fmu.rejected("a start value", |fmu| fmu.try_set(&[vr], &[wrong])));
            let enter = |fmu: &fmi3::Importer| fmu.fmi3EnterInitializationMode(0, 0.0, 0.0, 0, 0.0);
            assert_eq!(words(fmu.rejected("to begin", enter)), first);
            fmu.set(&[vr], &[right]);
            fmu.initialize(0.0);
        }
    }
}
