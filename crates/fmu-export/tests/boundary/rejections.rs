//! Invalid calls are rejected: `fmi2Error`, one message with the reason, and no change. [`Importer::refused`]
//! checks this; the tables here list the calls and parts of their messages.

use crate::INTERFACES;
use crate::models::{Ball, Oscillator, Sum, Talker, oscillator::Name, talker};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::*;
use fmu_export::{Exported, Model, Status, Variables};
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

/// Label, call, and parts of the message.
type Case = (&'static str, fn(&Importer) -> Status, &'static [&'static str]);

#[track_caller]
fn all_rejected(fmu: &Importer, cases: &[Case]) {
    for (label, call, words) in cases {
        let message = fmu.rejected(label, call);
        for word in *words {
            assert!(message.contains(word), "{label}: '{word}' is not in: {message}");
        }
    }
}

/// Invalid value references and arrays, for both interface types and all modes with getters and setters.
const ARRAYS: &[Case] = &[
    ("get, unknown", |fmu| fmu.fmi2GetReal(&UNKNOWN, 1, &mut 0.0), &["value reference 12"]),
    ("get, one of three", |fmu| fmu.fmi2GetReal([0, 99, 1].as_ptr(), 3, [0.0; 3].as_mut_ptr()), &["99"]),
    (
        "get Real of an Integer",
        |fmu| fmu.fmi2GetReal(&SPRINGS, 1, &mut 0.0),
        &["springs is of type Integer", "Real"],
    ),
    ("set, unknown", |fmu| fmu.try_set(&[UNKNOWN], &[0.0]), &["12"]),
    ("set, last of two", |fmu| fmu.try_set(&[FORCE, 99], &[0.1, 0.2]), &["99"]),
    ("set Real of an Integer", |fmu| fmu.try_set(&[SPRINGS], &[7.0]), &["springs is of type Integer"]),
    ("set Integer of a Real", |fmu| fmu.fmi2SetInteger(&MASS, 1, &1), &["mass is of type Real"]),
    ("set String of a Boolean", |fmu| fmu.fmi2SetString(&DAMPED, 1, &c"1".as_ptr()), &["damped"]),
    ("set calculated", |fmu| fmu.try_set(&[ENERGY], &[0.0]), &["energy cannot be set"]),
    ("set NaN", |fmu| fmu.try_set(&[MASS, FORCE], &[1.1, NAN]), &["force", "finite"]),
    ("set infinity", |fmu| fmu.try_set(&[FORCE], &[INF]), &["force", "finite", "inf"]),
];

#[test]
fn value_references_and_arrays() {
    for interface in INTERFACES {
        all_rejected(&Importer::in_mode::<Oscillator>(interface, Initialization), ARRAYS);
    }
    all_rejected(&Importer::in_mode::<Oscillator>(CoSimulation, StepComplete), ARRAYS);
    all_rejected(&Importer::in_mode::<Oscillator>(ModelExchange, Event), ARRAYS);
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

/// Parameters out of their range, with parts of the message.
const PARAMETERS: &[Case] = &[
    ("mass = 0", |fmu| fmu.try_set(&[MASS], &[0.0]), &["mass", "below 0.001", "0"]),
    ("mass < 0", |fmu| fmu.try_set(&[MASS], &[-0.1]), &["mass", "-0.1"]),
    ("mass too large", |fmu| fmu.try_set(&[MASS], &[1e7]), &["mass", "above 1000000"]),
    ("damping < 0", |fmu| fmu.try_set(&[DAMPING], &[-1e-300]), &["damping"]),
    ("stiffness NaN", |fmu| fmu.try_set(&[STIFFNESS], &[NAN]), &["stiffness", "finite"]),
    ("mass good, stiffness bad", |fmu| fmu.try_set(&[MASS, STIFFNESS], &[1.1, -1.0]), &["stiffness"]),
    ("force good, mass bad", |fmu| fmu.try_set(&[FORCE, MASS], &[0.1, 0.0]), &["mass"]),
    ("do not fit together", |fmu| fmu.try_set(&[FORCE, DAMPING], &[0.1, 20.0]), &["nothing oscillates"]),
    ("springs = 0", |fmu| fmu.fmi2SetInteger(&SPRINGS, 1, &0), &["springs", "1", "9", "0"]),
    ("springs, second bad", |fmu| fmu.fmi2SetInteger([SPRINGS; 2].as_ptr(), 2, [9, 10].as_ptr()), &["10"]),
    ("damped = 2", |fmu| fmu.fmi2SetBoolean(&DAMPED, 1, &2), &["damped", "2"]),
];

#[test]
fn parameters_out_of_range() {
    for interface in INTERFACES {
        all_rejected(&Importer::in_mode::<Oscillator>(interface, Instantiated), PARAMETERS);
        all_rejected(&Importer::in_mode::<Oscillator>(interface, Initialization), PARAMETERS);
    }
    all_rejected(&Importer::in_mode::<Oscillator>(CoSimulation, StepComplete), PARAMETERS);
}

/// Checks that all values of one call are checked together: one by one they would be rejected.
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

const HEARD: u32 = talker::Name::heard as u32;
const GREETING: u32 = talker::Name::greeting as u32;

const TEXTS: &[Case] = &[
    ("no UTF-8", |fmu| fmu.fmi2SetString(&HEARD, 1, &c"\xff\xfe".as_ptr()), &["heard is not UTF-8"]),
    ("half a letter", |fmu| fmu.fmi2SetString(&HEARD, 1, &c"G\xc3".as_ptr()), &["heard is not UTF-8"]),
    ("NULL text", |fmu| fmu.fmi2SetString(&GREETING, 1, &null()), &["greeting is NULL"]),
    (
        "second NULL",
        |fmu| fmu.fmi2SetString([GREETING, HEARD].as_ptr(), 2, [c"a".as_ptr(), null()].as_ptr()),
        &["heard is NULL"],
    ),
    (
        "of an output",
        |fmu| fmu.fmi2SetString(&(talker::Name::reply as u32), 1, &c"a".as_ptr()),
        &["reply cannot be set"],
    ),
    (
        "of an Integer",
        |fmu| fmu.fmi2SetString(&(talker::Name::answer as u32), 1, &null()),
        &["answer is of type Integer"],
    ),
    ("of nothing", |fmu| fmu.fmi2SetString(&99, 1, &c"\xff".as_ptr()), &["value reference 99"]),
    (
        "a constant",
        |fmu| fmu.fmi2SetInteger(&(talker::Name::answer as u32), 1, &42),
        &["answer cannot be set"],
    ),
    (
        "Integer of a text",
        |fmu| fmu.fmi2GetInteger(&HEARD, 1, &mut 0),
        &["heard is of type String, not Integer"],
    ),
];

#[test]
fn texts() {
    for (interface, mode) in
        [(CoSimulation, StepComplete), (ModelExchange, Event), (CoSimulation, Instantiated)]
    {
        let fmu = Importer::in_mode::<Talker>(interface, mode);
        let readable = mode != Instantiated;
        let get = TEXTS.len() - 1;
        all_rejected(&fmu, if readable { TEXTS } else { &TEXTS[..get] });
    }
}

#[test]
fn experiments() {
    let setup = |defined, tolerance, start, stop_defined, stop| {
        move |fmu: &Importer| fmu.fmi2SetupExperiment(defined, tolerance, start, stop_defined, stop)
    };
    for interface in INTERFACES {
        let fmu = Importer::in_mode::<Oscillator>(interface, Instantiated);
        for (label, call, word) in [
            ("tolerance NaN", setup(1, NAN, 0.0, 0, 0.0), "tolerance"),
            ("tolerance infinite", setup(1, INF, 0.0, 0, 0.0), "tolerance"),
            ("tolerance < 0", setup(1, -1e-6, 0.0, 0, 0.0), "tolerance"),
            ("start NaN", setup(0, 0.0, NAN, 0, 0.0), "startTime"),
            ("start infinite", setup(0, 0.0, -INF, 0, 0.0), "startTime"),
            ("stop before start", setup(0, 0.0, 1.0, 1, 0.5), "stopTime"),
            ("stop NaN", setup(0, 0.0, 0.0, 1, NAN), "stopTime"),
        ] {
            let message = fmu.rejected(label, call);
            assert!(message.contains(word), "{message}");
        }
        // Undefined values are ignored; a tolerance of 0 means none.
        fmu.ok(setup(0, NAN, 0.0, 0, NAN)(&fmu));
        fmu.ok(setup(1, 0.0, 0.0, 1, 0.0)(&fmu));
    }
}

#[test]
fn steps() {
    let fmu = Importer::of::<Oscillator>(CoSimulation);
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
        let message = fmu.rejected(label, |fmu| fmu.try_step(point, step_size));
        assert!(message.contains(word), "{label}: {message}");
    }
    fmu.step(1.25, 0.75);
}

/// Checks that a step to infinity is rejected and the instance stays usable, and that reading an infinite
/// value is rejected.
#[test]
fn out_of_the_range_of_numbers() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, StepComplete);
    fmu.set(&[FORCE], &[f64::MAX]);
    fmu.set_rates([FORCE], [f64::MAX]);
    fmu.set(&[MASS], &[0.1]);
    fmu.rejected_with(&["range of numbers"], |fmu| fmu.try_step(0.0, 1e3));
    fmu.rejected("an infinite rate", |fmu| fmu.fmi2GetRealOutputDerivatives(&ACCELERATION, 1, &1, &mut 0.0));
    fmu.set(&[FORCE], &[0.1]);
    fmu.set_rates([FORCE], [0.0]);
    fmu.step(0.0, 10.0);
    let fmu = Importer::in_mode::<Oscillator>(ModelExchange, ContinuousTime);
    fmu.set(&[POSITION, FORCE], &[1e200, 0.1]);
    fmu.rejected_with(&["energy is out of the range of numbers"], |fmu| {
        fmu.fmi2GetReal(&ENERGY, 1, &mut 0.0)
    });
    fmu.set(&[POSITION], &[f64::MAX]);
    fmu.rejected_with(&["der(velocity)"], |fmu| fmu.fmi2GetDerivatives([0.0; 2].as_mut_ptr(), 2));
    fmu.rejected("their partials", |fmu| {
        fmu.fmi2GetDirectionalDerivative(&ENERGY, 1, &POSITION, 1, &1e10, &mut 0.0)
    });
}

const DERIVATIVES: &[Case] = &[
    ("order 0", |fmu| fmu.fmi2SetRealInputDerivatives(&FORCE, 1, &0, &0.0), &["force", "order", "0"]),
    ("order -1", |fmu| fmu.fmi2SetRealInputDerivatives(&FORCE, 1, &-1, &0.0), &["force", "-1"]),
    ("NaN", |fmu| fmu.fmi2SetRealInputDerivatives(&FORCE, 1, &1, &NAN), &["force", "finite"]),
    ("infinity of order 3", |fmu| fmu.fmi2SetRealInputDerivatives(&FORCE, 1, &3, &INF), &["force"]),
    ("of an output", |fmu| fmu.fmi2SetRealInputDerivatives(&ENERGY, 1, &1, &0.0), &["energy", "input"]),
    ("of a parameter", |fmu| fmu.fmi2SetRealInputDerivatives(&MASS, 1, &1, &0.0), &["mass", "input"]),
    ("of an Integer", |fmu| fmu.fmi2SetRealInputDerivatives(&SPRINGS, 1, &1, &0.0), &["springs", "Integer"]),
    ("of nothing", |fmu| fmu.fmi2SetRealInputDerivatives(&UNKNOWN, 1, &1, &0.0), &["12"]),
    (
        "good and bad",
        |fmu| fmu.fmi2SetRealInputDerivatives([FORCE; 2].as_ptr(), 2, [1, 0].as_ptr(), [0.5; 2].as_ptr()),
        &["force"],
    ),
    (
        "output, order 0",
        |fmu| fmu.fmi2GetRealOutputDerivatives(&ENERGY, 1, &0, &mut 0.0),
        &["energy", "order"],
    ),
    (
        "output, order -2",
        |fmu| fmu.fmi2GetRealOutputDerivatives(&ENERGY, 1, &-2, &mut 0.0),
        &["energy", "-2"],
    ),
    (
        "output, Integer",
        |fmu| fmu.fmi2GetRealOutputDerivatives(&SPRINGS, 1, &1, &mut 0.0),
        &["springs", "Integer"],
    ),
];

#[test]
fn derivatives_with_respect_to_time() {
    all_rejected(&Importer::in_mode::<Oscillator>(CoSimulation, StepComplete), DERIVATIVES);
}

fn directional(fmu: &Importer, unknown: u32, known: u32, seed: f64) -> Status {
    fmu.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &seed, &mut 0.0)
}

const DIRECTIONAL: &[Case] = &[
    ("of an input", |fmu| directional(fmu, FORCE, FORCE, 1.0), &["force", "unknown"]),
    ("of a parameter", |fmu| directional(fmu, MASS, FORCE, 1.0), &["mass", "unknown"]),
    ("of a local state", |fmu| directional(fmu, VELOCITY, FORCE, 1.0), &["velocity", "unknown"]),
    ("with respect to an output", |fmu| directional(fmu, SPRING_FORCE, ENERGY, 1.0), &["energy", "known"]),
    ("with respect to a derivative", |fmu| directional(fmu, ENERGY, ACCELERATION, 1.0), &["der(velocity)"]),
    ("with respect to an Integer", |fmu| directional(fmu, ENERGY, SPRINGS, 1.0), &["springs", "Integer"]),
    ("of nothing", |fmu| directional(fmu, UNKNOWN, FORCE, 1.0), &["12"]),
    ("with respect to nothing", |fmu| directional(fmu, ENERGY, UNKNOWN, 1.0), &["12"]),
    ("along NaN", |fmu| directional(fmu, ENERGY, FORCE, NAN), &["force", "seed"]),
];

#[test]
fn directional_derivatives() {
    for (interface, mode) in [(CoSimulation, StepComplete), (ModelExchange, ContinuousTime)] {
        all_rejected(&Importer::in_mode::<Oscillator>(interface, mode), DIRECTIONAL);
    }
}

const STATES: &[Case] = &[
    ("one state", |fmu| fmu.fmi2SetContinuousStates([0.1; 1].as_ptr(), 1), &["2", "1"]),
    ("three states", |fmu| fmu.fmi2SetContinuousStates([0.1; 3].as_ptr(), 3), &["2", "3"]),
    ("no states", |fmu| fmu.fmi2SetContinuousStates(null(), 0), &["2", "0"]),
    ("last state NaN", |fmu| fmu.fmi2SetContinuousStates([0.1, NAN].as_ptr(), 2), &["velocity", "finite"]),
    ("one event indicator", |fmu| fmu.fmi2GetEventIndicators(&mut 0.0, 1), &["no event indicators"]),
    ("time NaN", |fmu| fmu.fmi2SetTime(NAN), &["time", "finite"]),
    ("time infinite", |fmu| fmu.fmi2SetTime(INF), &["time", "finite"]),
];

#[test]
fn continuous_states() {
    all_rejected(&Importer::in_mode::<Oscillator>(ModelExchange, ContinuousTime), STATES);
    let fmu = Importer::in_mode::<Oscillator>(ModelExchange, Event);
    fmu.rejected_with(&["NULL"], |fmu| fmu.fmi2NewDiscreteStates(null_mut()));
    let fmu = Importer::in_mode::<Ball>(ModelExchange, ContinuousTime);
    fmu.rejected_with(&["1 event indicators, not 0"], |fmu| fmu.fmi2GetEventIndicators(null_mut(), 0));
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
    // Each query has one function; the other functions name it in their message.
    fmu.ok(fmu.set_debug_logging(true, &[c"logStatusDiscard"]));
    type Question = fn(&Importer) -> Status;
    let questions: &[(Question, &str)] = &[
        (|fmu| fmu.fmi2GetRealStatus(0, &mut 0.0), "synchronously"),
        (|fmu| fmu.fmi2GetRealStatus(3, &mut 0.0), "fmi2GetBooleanStatus"),
        (|fmu| fmu.fmi2GetBooleanStatus(2, &mut 0), "fmi2GetRealStatus"),
        (|fmu| fmu.fmi2GetStringStatus(1, &mut null()), "synchronously"),
        (|fmu| fmu.fmi2GetIntegerStatus(2, &mut 0), "fmi2GetRealStatus"),
    ];
    for (question, word) in questions {
        assert_eq!(question(&fmu), Status::Discard);
        let log = fmu.take_log();
        assert!(log.len() == 1 && log[0].text.contains(word), "{log:?}");
    }

    fmu.step(0.0, 0.25);
    let (mut time, mut terminated) = (0.0, -1);
    fmu.ok(fmu.fmi2GetRealStatus(2, &mut time));
    fmu.ok(fmu.fmi2GetBooleanStatus(3, &mut terminated));
    assert_eq!((time, terminated), (0.25, 0));
}

/// Checks that there is no instance of the model with changed arguments, and parts of the message.
fn no_instance<F: Either, M: Exported>(change: impl Fn(&mut Arguments<'static>), words: &[&str]) {
    let mut arguments = Arguments::of::<M>(CoSimulation);
    change(&mut arguments);
    let Err(log) = F::make::<M>(&arguments) else { panic!("{words:?} is accepted") };
    let [message] = log.as_slice() else { panic!("{words:?}: one message expected, not {log:?}") };
    message.assert_clean();
    assert_eq!((message.status, message.category.as_str()), (Status::Error, "logStatusError"), "{words:?}");
    for word in words.iter().chain(&[&format!("{}Instantiate", &F::functions()[0][..4])[..]]) {
        assert!(message.text.contains(word), "'{word}' is not in: {}", message.text);
    }
    // Without a logger the call is rejected as well.
    arguments.logger = false;
    assert!(F::make::<M>(&arguments).is_err_and(|log| log.is_empty()), "{words:?}, silently");
}

#[test]
fn instantiation() {
    fn check<F: Either>(guid: &str) {
        no_instance::<F, Sum>(|a| a.instance_name = None, &["the instance needs a name"]);
        no_instance::<F, Sum>(|a| a.instance_name = Some(c""), &["the instance needs a name"]);
        no_instance::<F, Sum>(|a| a.instance_name = Some(c" \t "), &["the instance needs a name"]);
        no_instance::<F, Sum>(|a| a.guid = None, &[guid, "NULL is not"]);
        no_instance::<F, Sum>(|a| a.guid = Some(CString::default()), &[guid]);
        no_instance::<F, Sum>(|a| a.guid = Some(c"{1%s-#r1#}".into()), &[guid, "{1_s-_r1_}", "{sum}"]);
        no_instance::<F, Sum>(|a| a.guid = CString::new(Talker::INFO.guid).ok(), &["{talker}", "{sum}"]);
        no_instance::<F, Sum>(|a| a.fmu_type = 0, &["this FMU has no Model Exchange"]);
        no_instance::<F, drift::Drift>(|_| (), &["this FMU has no Co-Simulation"]);
    }
    check::<Importer>("guid");
    check::<fmi3::Importer>("instantiationToken");
    no_instance::<Importer, Oscillator>(|a| a.fmu_type = 2, &["fmuType", "2"]);
    no_instance::<Importer, Oscillator>(|a| a.fmu_type = -1, &["fmuType", "-1"]);
    no_instance::<fmi3::Importer, Sum>(
        |a| a.required_intermediate_variables = &[0],
        &["requiredIntermediateVariables must be empty"],
    );
    let arguments = Arguments { callbacks: false, ..Arguments::of::<Oscillator>(CoSimulation) };
    assert!(Importer::try_with::<Oscillator>(&arguments).is_err());
    no_instance::<fmi3::Importer, Sum>(|a| a.fmu_type = 2, &["this FMU has no Scheduled Execution"]);
}

#[test]
fn instances_of_the_other_version() {
    let old = Importer::of::<Sum>(CoSimulation);
    let functions = fmu_export::fmi3::functions::<Sum>();
    // SAFETY: a live instance of the same model.
    let status = unsafe { (functions.fmi3Reset)(old.instance()) };
    assert_eq!(Status::from_c(status), Status::Error);
}

/// A model that supports only Model Exchange.
mod drift {
    use fmu_export::*;

    #[derive(Clone, Default)]
    pub struct Drift {
        x: f64,
    }

    variables! { for Drift;
        /// Grows
        x = output(&NUMBER).state() in x;
        /// As fast as this
        der_x = local(&NUMBER).derivative_of(x) by |_| 1.0;
    }

    impl Model for Drift {
        const INFO: Info = info!("Drift", "drift");

        fn new(_: &Setup) -> Result<Self, Error> {
            Ok(Self::default())
        }
    }

    impl ModelExchange for Drift {}

    offer!(Drift: ModelExchange);
}
