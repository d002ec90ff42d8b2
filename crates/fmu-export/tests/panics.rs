//! A model whose every method can panic: the importer gets `fmi2Fatal` and a message, and its process, its other
//! instances and its memory are safe.
#![allow(missing_docs)]

mod toys;

use fmu_export::Interface::{self, CoSimulation, ModelExchange};
use fmu_export::fmi2::types::*;
use fmu_run::testing::assert_clean;
use fmu_run::{Arguments, Functions, Importer};
use std::ptr::{null, null_mut};
use toys::Faulty;
use toys::faulty::{Fault, Name, while_all_break};

const U: u32 = Name::u as u32;
const Y: u32 = Name::y as u32;
const X: u32 = Name::x as u32;
const TRUTH: u32 = Name::truth as u32;
const TEXT: u32 = Name::text as u32;

fn set_fault(fmu: &Importer, fault: Fault) -> Status {
    fmu.fmi2SetInteger(&(Name::fault as u32), 1, &(fault as i32))
}

/// Runs the call, which must be fatal, with one message about it.
#[track_caller]
fn fatal(fmu: &Importer, label: &str, call: impl FnOnce(&Importer) -> Status) -> String {
    fmu.take_log();
    let status = without_output(|| call(fmu));
    let log = fmu.take_log();
    assert_eq!(status, Status::Fatal, "{label}: {log:?}");
    assert_eq!(log.len(), 1, "{label}: {log:?}");
    assert_clean(&log[0]);
    assert_eq!((log[0].status, log[0].category.as_str()), (Status::Fatal, "logStatusFatal"), "{label}");
    log[0].text.clone()
}

/// Runs the function on a saved state of the instance.
fn with_state(fmu: &Importer, function: impl FnOnce(&mut fmi2FMUstate) -> Status) -> Status {
    let mut state = fmu.save();
    let status = function(&mut state);
    Importer::of::<Faulty>(CoSimulation).forget(state);
    status
}

type Call = fn(&Importer) -> Status;

/// A call that breaks an instance with this fault: every function that runs a model's code.
const CALLS: &[(Interface, &str, Fault, Call)] = &[
    (CoSimulation, "fmi2GetReal", Fault::Read, |fmu| fmu.fmi2GetReal(&Y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetReal", Fault::NoMessage, |fmu| fmu.fmi2GetReal(&Y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetReal", Fault::Bomb, |fmu| fmu.fmi2GetReal(&Y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetReal", Fault::Calculate, |fmu| fmu.fmi2GetReal(&Y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetInteger", Fault::Read, |fmu| fmu.fmi2GetInteger(&(Name::n as u32), 1, &mut 0)),
    (CoSimulation, "fmi2GetBoolean", Fault::Read, |fmu| fmu.fmi2GetBoolean(&TRUTH, 1, &mut 0)),
    (CoSimulation, "fmi2GetString", Fault::ReadText, |fmu| fmu.fmi2GetString(&TEXT, 1, &mut null())),
    (CoSimulation, "fmi2SetReal", Fault::Then, |fmu| fmu.try_set(&[U], &[1.0])),
    (CoSimulation, "fmi2SetInteger", Fault::Update, |fmu| set_fault(fmu, Fault::Update)),
    (CoSimulation, "fmi2SetInteger", Fault::None, |fmu| {
        while_all_break(Fault::Clone, || set_fault(fmu, Fault::None))
    }),
    (CoSimulation, "fmi2SetInteger", Fault::Drop, |fmu| set_fault(fmu, Fault::None)),
    (CoSimulation, "fmi2SetBoolean", Fault::Then, |fmu| fmu.fmi2SetBoolean(&TRUTH, 1, &1)),
    (CoSimulation, "fmi2SetString", Fault::Then, |fmu| fmu.fmi2SetString(&TEXT, 1, &c"a".as_ptr())),
    (CoSimulation, "fmi2SetInteger", Fault::Log, |fmu| set_fault(fmu, Fault::Log)),
    (CoSimulation, "fmi2DoStep", Fault::Step, |fmu| fmu.try_step(0.0, 0.1)),
    (CoSimulation, "fmi2SetRealInputDerivatives", Fault::InputDerivative, |fmu| {
        fmu.fmi2SetRealInputDerivatives(&U, 1, &1, &1.0)
    }),
    (CoSimulation, "fmi2GetRealOutputDerivatives", Fault::OutputDerivative, |fmu| {
        fmu.fmi2GetRealOutputDerivatives(&Y, 1, &1, &mut 0.0)
    }),
    (CoSimulation, "fmi2GetDirectionalDerivative", Fault::Partial, |fmu| {
        fmu.fmi2GetDirectionalDerivative(&Y, 1, &U, 1, &1.0, &mut 0.0)
    }),
    (ModelExchange, "fmi2NewDiscreteStates", Fault::Event, |fmu| {
        fmu.ok(fmu.fmi2EnterEventMode());
        fmu.fmi2NewDiscreteStates(&mut Default::default())
    }),
    (ModelExchange, "fmi2CompletedIntegratorStep", Fault::StepCompleted, |fmu| {
        fmu.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0)
    }),
    (ModelExchange, "fmi2GetEventIndicators", Fault::Indicators, |fmu| {
        fmu.fmi2GetEventIndicators(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi2GetNominalsOfContinuousStates", Fault::Nominals, |fmu| {
        fmu.fmi2GetNominalsOfContinuousStates(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi2GetDerivatives", Fault::Read, |fmu| fmu.fmi2GetDerivatives(&mut 0.0, 1)),
    (ModelExchange, "fmi2GetContinuousStates", Fault::Calculate, |fmu| {
        fmu.fmi2GetContinuousStates(&mut 0.0, 1)
    }),
    (ModelExchange, "fmi2SetContinuousStates", Fault::Then, |fmu| fmu.fmi2SetContinuousStates(&0.0, 1)),
    (ModelExchange, "fmi2SetReal", Fault::Then, |fmu| fmu.try_set(&[X], &[1.0])),
    (CoSimulation, "fmi2GetFMUstate", Fault::None, |fmu| {
        let mut state = null_mut();
        let status = while_all_break(Fault::Clone, || fmu.fmi2GetFMUstate(&mut state));
        assert!(state.is_null());
        status
    }),
    (CoSimulation, "fmi2GetFMUstate", Fault::None, |fmu| {
        with_state(fmu, |state| while_all_break(Fault::Clone, || fmu.fmi2GetFMUstate(state)))
    }),
    (CoSimulation, "fmi2SetFMUstate", Fault::None, |fmu| {
        with_state(fmu, |state| while_all_break(Fault::Clone, || fmu.fmi2SetFMUstate(*state)))
    }),
    (CoSimulation, "fmi2FreeFMUstate", Fault::Drop, |fmu| {
        with_state(fmu, |state| {
            let status = fmu.fmi2FreeFMUstate(state);
            assert!(state.is_null());
            status
        })
    }),
    (CoSimulation, "fmi2SerializedFMUstateSize", Fault::Memory, |fmu| {
        with_state(fmu, |state| fmu.fmi2SerializedFMUstateSize(*state, &mut 0))
    }),
    (CoSimulation, "fmi2SerializeFMUstate", Fault::Memory, |fmu| {
        with_state(fmu, |state| fmu.fmi2SerializeFMUstate(*state, [0; 100].as_mut_ptr(), 100))
    }),
    (CoSimulation, "fmi2DeSerializeFMUstate", Fault::Memory, |fmu| {
        let bytes = Importer::of::<Faulty>(CoSimulation).bytes();
        let mut state = null_mut();
        let status = fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state);
        assert!(state.is_null());
        status
    }),
];

/// Faults that show as soon as the parameter says so: it is set by the call itself.
fn shows_at_once(fault: Fault) -> bool {
    [Fault::Update, Fault::Log].contains(&fault)
}

/// One test, because what Rust prints about panics is switched off for the whole process.
#[test]
fn every_panic_is_contained() {
    let bystanders = [CoSimulation, ModelExchange].map(Importer::of::<Faulty>);
    for bystander in &bystanders {
        bystander.initialize(0.0);
    }
    for (interface, name, fault, call) in CALLS {
        let fmu = Importer::of::<Faulty>(*interface);
        fmu.initialize(0.0);
        if !shows_at_once(*fault) {
            fmu.ok(set_fault(&fmu, *fault));
        }
        if *interface == ModelExchange {
            fmu.ok(fmu.fmi2EnterContinuousTimeMode());
        }
        let message = fatal(&fmu, name, call);
        let reason = match *fault {
            Fault::NoMessage | Fault::Bomb => "no message".into(),
            Fault::None => "fault _Clone at 100_s".into(),
            fault => format!("fault _{fault:?} at 100_s"),
        };
        assert!(message.starts_with(name) && message.contains(&reason), "{message}");
        check_that_all_is_over(&fmu);
        without_output(|| drop(fmu));
        for bystander in &bystanders {
            assert_eq!(bystander.get([Y]), [0.5], "{name}");
        }
    }

    let fmu = Importer::of::<Faulty>(CoSimulation);
    fmu.ok(set_fault(&fmu, Fault::Initialize));
    fatal(&fmu, "fmi2EnterInitializationMode", |fmu| fmu.fmi2EnterInitializationMode());
    check_that_all_is_over(&fmu);

    // A panic while an instance is freed ends with it.
    let fmu = Importer::of::<Faulty>(CoSimulation);
    fmu.ok(set_fault(&fmu, Fault::Drop));
    without_output(|| drop(fmu));

    // A panic while one is made, for the first time and by a reset.
    let fmu = Importer::of::<Faulty>(CoSimulation);
    fatal(&fmu, "fmi2Reset", |fmu| while_all_break(Fault::New, || fmu.fmi2Reset()));
    check_that_all_is_over(&fmu);
    let none = || Importer::instantiate(Functions::of::<Faulty>(), &Arguments::of::<Faulty>(CoSimulation));
    let log = without_output(|| while_all_break(Fault::New, none)).expect_err("no instance comes of a panic");
    assert_eq!(log.len(), 1, "a message about a panic in fmi2Instantiate: {log:?}");
    assert!(log[0].text.contains("fault _New at 100_s"), "{log:?}");

    let [co_simulation, model_exchange] = &bystanders;
    co_simulation.step(0.0, 0.1);
    model_exchange.ok(model_exchange.fmi2EnterContinuousTimeMode());
    assert_eq!([co_simulation.take_log(), model_exchange.take_log()], [vec![], vec![]]);
}

/// What Rust prints about a panic stays out of the test's output.
fn without_output<T>(work: impl FnOnce() -> T) -> T {
    std::panic::set_hook(Box::new(|_| {}));
    let result = work();
    let _ = std::panic::take_hook();
    result
}

/// After a panic every function is fatal and says so; only freeing is left, which the end of the test does.
fn check_that_all_is_over(fmu: &Importer) {
    let answers = fmu.call_all();
    let log = fmu.take_log();
    assert_eq!((answers.len(), log.len()), (40, 40));
    for ((name, status), message) in answers.iter().zip(&log) {
        assert_eq!((*status, message.status), (Status::Fatal, Status::Fatal), "{name}");
        assert!(message.text.starts_with(name) && message.text.contains("fatal"), "{message:?}");
        assert_eq!(message.category, "logStatusFatal");
    }
}
