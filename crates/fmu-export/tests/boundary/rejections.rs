//! Invalid calls are rejected: they return `fmi2Error`, log one message with the reason, and change nothing.
//! [`Either::rejected`] checks this for the calls listed here. Calls of one topic, such as saved states, are in other files.

use crate::models::{Ball, Fuse, Oscillator, Talker, oscillator::Name, talker};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::{Exported, Status, Variables};
use fmu_test_kit::{Arguments, Either, Importer, fmi3};
use std::ffi::CString;
use std::ptr::{null, null_mut};

const FORCE: u32 = Name::force as u32;
const POSITION: u32 = Name::position as u32;
const VELOCITY: u32 = Name::velocity as u32;
const ACCELERATION: u32 = Name::der_velocity as u32;
const SPRING_FORCE: u32 = Name::spring_force as u32;
const ENERGY: u32 = Name::energy as u32;
const MASS: u32 = Name::mass as u32;
const STIFFNESS: u32 = Name::stiffness as u32;
const SPRINGS: u32 = Name::springs as u32;
const DAMPING: u32 = Name::damping as u32;
const DAMPED: u32 = Name::damped as u32;
const UNKNOWN: u32 = Oscillator::TABLE.len() as u32;
const NAN: f64 = f64::NAN;
const INF: f64 = f64::INFINITY;

/// A call, and parts of the message with which it is rejected.
type Case = (fn(&Importer) -> Status, &'static [&'static str]);

#[track_caller]
fn all_rejected(fmu: &Importer, cases: &[Case]) {
    cases.iter().for_each(|(call, words)| fmu.rejected_with(words, call));
}

/// Calls with variables of another type, and with values out of their range. `indices.rs` checks invalid value references.
const VALUES: &[Case] = &[
    (|fmu| fmu.set_integer(MASS, 1), &["mass is of type Real, not Integer"]),
    (|fmu| fmu.set_string(DAMPED, c"1".as_ptr()), &["damped is of type Boolean, not String"]),
    (|fmu| fmu.try_set(&[SPRINGS], &[7.0]), &["springs is of type Integer, not Real"]),
    (|fmu| fmu.try_set(&[FORCE], &[INF]), &["force must be a finite number, it is inf"]),
    (|fmu| fmu.try_set(&[MASS, STIFFNESS], &[1.1, NAN]), &["stiffness must be a finite number"]),
    (|fmu| fmu.try_set(&[FORCE, MASS], &[0.1, 0.0]), &["mass must not be below 0.001, it is 0"]),
    (|fmu| fmu.try_set(&[MASS], &[1e7]), &["mass must not be above 1000000, it is 10000000"]),
    (|fmu| fmu.try_set(&[DAMPING], &[-1e-300]), &["damping must not be below 0, it is -1e-300"]),
    (|fmu| fmu.try_set(&[FORCE, DAMPING], &[0.1, 20.0]), &["nothing oscillates"]),
    (|fmu| fmu.set_integer(SPRINGS, 0), &["springs must be between 1 and 9, it is 0"]),
    (|fmu| fmu.fmi2SetInteger([SPRINGS; 2].as_ptr(), 2, [9, 10].as_ptr()), &["springs", "it is 10"]),
];

#[test]
fn values() {
    for mode in [Instantiated, Initialization, StepComplete] {
        all_rejected(&Importer::in_mode::<Oscillator>(CoSimulation, mode), VALUES);
    }
}

#[test]
fn empty_arrays_are_fine() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, Initialization);
    fmu.ok(fmu.fmi2GetReal(null(), 0, null_mut()));
    fmu.ok(fmu.fmi2SetInteger(null(), 0, null()));
    fmu.ok(fmu.fmi2GetString(null(), 0, null_mut()));
    fmu.ok(fmu.fmi2SetString(null(), 0, null()));
    fmu.ok(fmu.fmi2GetDirectionalDerivative(null(), 0, null(), 0, null(), null_mut()));
    fmu.ok(fmu.fmi2SetRealInputDerivatives(null(), 0, null(), null()));
}

/// Checks that the values of one call are validated together. Set one by one, they would be rejected.
#[test]
fn combinations_are_set_together() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, Instantiated);
    fmu.rejected("the damping alone", |fmu| fmu.try_set(&[DAMPING], &[30.0]));
    fmu.set(&[DAMPING, STIFFNESS], &[30.0, 5000.0]);
    fmu.rejected("the stiffness alone", |fmu| fmu.try_set(&[STIFFNESS], &[50.0]));
    fmu.ok(fmu.fmi2SetBoolean(&DAMPED, 1, &0));
    fmu.set(&[STIFFNESS], &[50.0]);
    fmu.rejected("the damper again", |fmu| fmu.fmi2SetBoolean(&DAMPED, 1, &1));
}

/// Checks rejected strings, and that the type of a variable is checked before its value.
#[test]
fn strings() {
    const GREETING: u32 = talker::Name::greeting as u32;
    const HEARD: u32 = talker::Name::heard as u32;
    all_rejected(
        &Importer::in_mode::<Talker>(CoSimulation, StepComplete),
        &[
            (|fmu| fmu.set_string(talker::Name::answer as u32, null()), &["answer is of type Integer"]),
            (|fmu| fmu.set_string(99, c"\xff".as_ptr()), &["value reference 99"]),
            (
                |fmu| fmu.fmi2SetString([GREETING, HEARD].as_ptr(), 2, [c"a".as_ptr(), null()].as_ptr()),
                &["heard is NULL"],
            ),
        ],
    );
}

#[test]
fn experiments() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, Instantiated);
    for (defined, tolerance, start, stop_defined, stop, word) in [
        (1, NAN, 0.0, 0, 0.0, "tolerance"),
        (1, INF, 0.0, 0, 0.0, "tolerance"),
        (1, -1e-6, 0.0, 0, 0.0, "tolerance"),
        (0, 0.0, NAN, 0, 0.0, "startTime"),
        (0, 0.0, -INF, 0, 0.0, "startTime"),
        (0, 0.0, 1.0, 1, 0.5, "stopTime"),
        (0, 0.0, 0.0, 1, NAN, "stopTime"),
    ] {
        fmu.rejected_with(&[word], |fmu| {
            fmu.fmi2SetupExperiment(defined, tolerance, start, stop_defined, stop)
        });
    }
    // Values that are not defined are ignored, and a tolerance of 0 is accepted.
    fmu.ok(fmu.fmi2SetupExperiment(0, NAN, 0.0, 0, NAN));
    fmu.ok(fmu.fmi2SetupExperiment(1, 0.0, 0.0, 1, 0.0));
}

#[test]
fn steps() {
    let fmu = Importer::new::<Oscillator>(CoSimulation);
    fmu.enter_initialization(1.0, Some(2.0));
    fmu.ok(fmu.fmi2ExitInitializationMode());
    fmu.step(1.0, 0.25);
    for (point, step_size, word) in [
        (1.0, 0.0, "1.25"),
        (NAN, 0.0, "point"),
        (INF, 0.0, "point"),
        (1.25, -0.25, "step size"),
        (1.25, NAN, "step size"),
        (1.25, INF, "step size"),
        (1.25, 1e-17, "too small"),
        (NAN, 0.25, "point"),
        (INF, 0.25, "point"),
        (1.0, 0.25, "1.25"),
        (1.5, 0.25, "1.25"),
        (1.25 + 1e-6, 0.25, "1.25"),
        (1.25, 0.76, "stop time 2"),
        (1.25, 1e300, "stop time 2"),
    ] {
        fmu.rejected_with(&[word], |fmu| fmu.try_step(point, step_size));
    }
    fmu.step(1.25, 0.75);
}

/// Checks that a step is rejected if the state would become infinite, that the instance then works as before, and that
/// reading an infinite value is rejected.
#[test]
fn results_that_are_not_finite() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    fmu.set(&[FORCE], &[f64::MAX]);
    fmu.set_input_derivatives(&[FORCE], &[f64::MAX]);
    fmu.set(&[MASS], &[0.1]);
    fmu.rejected_with(&["position or velocity would not be finite"], |fmu| fmu.try_step(0.0, 1e3));
    fmu.rejected("an infinite rate", |fmu| fmu.fmi2GetRealOutputDerivatives(&ACCELERATION, 1, &1, &mut 0.0));
    fmu.set(&[FORCE], &[0.1]);
    fmu.set_input_derivatives(&[FORCE], &[0.0]);
    fmu.step(0.0, 10.0);
    let fmu = Importer::in_mode::<Oscillator>(ModelExchange, ContinuousTime);
    fmu.set(&[POSITION, FORCE], &[1e200, 0.1]);
    fmu.rejected_with(&["energy is not a finite number"], |fmu| fmu.fmi2GetReal(&ENERGY, 1, &mut 0.0));
    fmu.set(&[POSITION], &[f64::MAX]);
    fmu.rejected_with(&["der(velocity)"], |fmu| fmu.fmi2GetDerivatives([0.0; 2].as_mut_ptr(), 2));
    fmu.rejected("their partials", |fmu| {
        fmu.fmi2GetDirectionalDerivative(&ENERGY, 1, &POSITION, 1, &1e10, &mut 0.0)
    });
}

#[test]
fn derivatives_with_respect_to_time() {
    let set = |fmu: &Importer, of, order, value| fmu.fmi2SetRealInputDerivatives(&of, 1, &order, &value);
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    for (of, order, value, words) in [
        (FORCE, 0, 0.0, "the order of the derivative of force must be at least 1, it is 0"),
        (FORCE, -1, 0.0, "it is -1"),
        (FORCE, 1, NAN, "the derivative of force must be a finite number"),
        (FORCE, 3, INF, "the derivative of force must be a finite number"),
        (ENERGY, 1, 0.0, "energy is not a continuous input"),
        (MASS, 1, 0.0, "mass is not a continuous input"),
        (SPRINGS, 1, 0.0, "springs is of type Integer"),
        (UNKNOWN, 1, 0.0, "value reference 12"),
    ] {
        fmu.rejected_with(&[words], |fmu| set(fmu, of, order, value));
    }
    let (vr, orders, values) = ([FORCE; 2], [1, 0], [0.5; 2]);
    fmu.rejected_with(&["force"], |fmu| {
        fmu.fmi2SetRealInputDerivatives(vr.as_ptr(), 2, orders.as_ptr(), values.as_ptr())
    });
    fmu.rejected_with(&["springs is of type Integer"], |fmu| fmu.try_rate(SPRINGS, 1, &mut 0.0));
}

#[test]
fn directional_derivatives() {
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, ContinuousTime)] {
        let fmu = Importer::in_mode::<Oscillator>(interface, mode);
        for (unknown, known, seed, words) in [
            (FORCE, FORCE, 1.0, "force is not an unknown"),
            (MASS, FORCE, 1.0, "mass is not an unknown"),
            (VELOCITY, FORCE, 1.0, "velocity is not an unknown"),
            (SPRING_FORCE, ENERGY, 1.0, "energy is not a known"),
            (ENERGY, ACCELERATION, 1.0, "der(velocity) is not a known"),
            (ENERGY, SPRINGS, 1.0, "springs is of type Integer"),
            (UNKNOWN, FORCE, 1.0, "value reference 12"),
            (ENERGY, UNKNOWN, 1.0, "value reference 12"),
            (ENERGY, FORCE, NAN, "the seed of force"),
        ] {
            fmu.rejected_with(&[words], |fmu| fmu.try_directional(&[unknown], &[known], &[seed], &mut [0.0]));
        }
    }
}

#[test]
fn continuous_states() {
    all_rejected(
        &Importer::in_mode::<Oscillator>(ModelExchange, ContinuousTime),
        &[
            (|fmu| fmu.set_states([0.1; 1].as_ptr(), 1), &["2 continuous states, the array has 1"]),
            (|fmu| fmu.set_states([0.1; 3].as_ptr(), 3), &["2 continuous states, the array has 3"]),
            (|fmu| fmu.set_states(null(), 0), &["2 continuous states, the array has 0"]),
            (|fmu| fmu.set_states([0.1, NAN].as_ptr(), 2), &["velocity must be a finite number"]),
            (|fmu| fmu.get_indicators(&mut 0.0, 1), &["no event indicators"]),
            (|fmu| fmu.set_time(NAN), &["time must be a finite number"]),
            (|fmu| fmu.set_time(INF), &["time must be a finite number"]),
        ],
    );
    let fmu = Importer::in_mode::<Ball>(ModelExchange, ContinuousTime);
    fmu.rejected_with(&["1 event indicators, not 0"], |fmu| fmu.get_indicators(null_mut(), 0));
}

#[test]
fn status_kinds() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    for kind in [-1, 4, i32::MAX] {
        fmu.rejected("GetStatus", |fmu| fmu.fmi2GetStatus(kind, &mut 0));
        fmu.rejected("GetRealStatus", |fmu| fmu.fmi2GetRealStatus(kind, &mut 0.0));
        fmu.rejected("GetIntegerStatus", |fmu| fmu.fmi2GetIntegerStatus(kind, &mut 0));
        fmu.rejected("GetBooleanStatus", |fmu| fmu.fmi2GetBooleanStatus(kind, &mut 0));
        fmu.rejected("GetStringStatus", |fmu| fmu.fmi2GetStringStatus(kind, &mut null()));
    }
    fmu.rejected("NULL", |fmu| fmu.fmi2GetRealStatus(2, null_mut()));
    fmu.rejected("NULL", |fmu| fmu.fmi2GetBooleanStatus(3, null_mut()));
    // Kinds 2 and 3 are each returned by one function. Other functions return Discard, with a message that names this function.
    // Kinds 0 and 1 concern only asynchronous steps.
    fmu.ok(fmu.set_debug_logging(true, &[c"logStatusDiscard"]));
    type Query = fn(&Importer) -> Status;
    let queries: &[(Query, &str)] = &[
        (|fmu| fmu.fmi2GetRealStatus(0, &mut 0.0), "synchronously"),
        (|fmu| fmu.fmi2GetRealStatus(3, &mut 0.0), "fmi2GetBooleanStatus"),
        (|fmu| fmu.fmi2GetBooleanStatus(2, &mut 0), "fmi2GetRealStatus"),
        (|fmu| fmu.fmi2GetStringStatus(1, &mut null()), "synchronously"),
        (|fmu| fmu.fmi2GetIntegerStatus(2, &mut 0), "fmi2GetRealStatus"),
    ];
    for (query, word) in queries {
        assert_eq!(query(&fmu), Status::Discard);
        let log = fmu.take_log();
        assert!(log.len() == 1 && log[0].message.contains(word), "{log:?}");
    }

    fmu.step(0.0, 0.25);
    let (mut time, mut terminated) = (0.0, -1);
    fmu.ok(fmu.fmi2GetRealStatus(2, &mut time));
    fmu.ok(fmu.fmi2GetBooleanStatus(3, &mut terminated));
    assert_eq!((time, terminated), (0.25, 0));
}

/// Checks that instantiation with changed arguments fails with a message that contains these strings.
fn no_instance<F: Either, M: Exported>(change: impl Fn(&mut Arguments<'static>), words: &[&str]) {
    let mut arguments = Arguments::new::<M>(CoSimulation);
    change(&mut arguments);
    let Err(log) = F::make::<M>(&arguments) else { panic!("{words:?} is accepted") };
    let [message] = log.as_slice() else { panic!("{words:?}: one message expected, not {log:?}") };
    message.assert_clean();
    assert_eq!((message.status, message.category.as_str()), (Status::Error, "logStatusError"), "{words:?}");
    for word in words.iter().chain(&[&format!("{}Instantiate", &F::functions()[0][..4])[..]]) {
        assert!(message.message.contains(word), "'{word}' is not in: {}", message.message);
    }
    // The call is also rejected without a logger.
    arguments.logger = false;
    assert!(F::make::<M>(&arguments).is_err_and(|log| log.is_empty()), "{words:?}, without a logger");
}

#[test]
fn instantiation() {
    fn check<F: Either>(guid: &str) {
        no_instance::<F, Fuse>(|a| a.instance_name = None, &["the instance needs a name"]);
        no_instance::<F, Fuse>(|a| a.instance_name = Some(c""), &["the instance needs a name"]);
        no_instance::<F, Fuse>(|a| a.instance_name = Some(c" \t "), &["the instance needs a name"]);
        no_instance::<F, Fuse>(|a| a.guid = None, &[guid, "NULL is not"]);
        no_instance::<F, Fuse>(|a| a.guid = Some(CString::default()), &[guid]);
        no_instance::<F, Fuse>(
            |a| a.guid = Some(c"{1%s-#r1#}".into()),
            &[guid, "{1_s-_r1_}", &fmu_export::guid::<Fuse>()],
        );
        no_instance::<F, Fuse>(|a| a.fmu_type = 0, &["this FMU has no Model Exchange"]);
        no_instance::<F, drift::Drift>(|_| (), &["this FMU has no Co-Simulation"]);
    }
    check::<Importer>("guid");
    check::<fmi3::Importer>("instantiationToken");
    no_instance::<Importer, Oscillator>(|a| a.fmu_type = 2, &["fmuType", "2"]);
    no_instance::<Importer, Oscillator>(|a| a.fmu_type = -1, &["fmuType", "-1"]);
    no_instance::<fmi3::Importer, Fuse>(
        |a| a.required_intermediate_variables = &[0],
        &["requiredIntermediateVariables must be empty"],
    );
    let arguments = Arguments { callbacks: false, ..Arguments::new::<Oscillator>(CoSimulation) };
    assert!(Importer::make::<Oscillator>(&arguments).is_err());
    no_instance::<fmi3::Importer, Fuse>(|a| a.fmu_type = 2, &["this FMU has no Scheduled Execution"]);
}

#[test]
fn instances_of_the_other_version() {
    let old = Importer::new::<Fuse>(CoSimulation);
    let functions = fmu_export::fmi3::functions::<Fuse>();
    // SAFETY: a live instance of the same model.
    let status = unsafe { (functions.fmi3Reset)(old.instance()) };
    assert_eq!(Status::from_c(status), Status::Error);
}

/// A model that supports only Model Exchange.
mod drift {
    use fmu_export::*;

    variables! {
        pub struct Drift;
        /// Grows
        x: f64 = output(&NUMBER).state();
        /// Rate
        der_x = local(&NUMBER).derivative_of(x) by |_| 1.0;
    }

    impl Model for Drift {
        const INFO: Info = info!("Drift", "drift");
    }

    impl ModelExchange for Drift {}

    offer!(Drift: ModelExchange);
}
