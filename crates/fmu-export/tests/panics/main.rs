//! Panics of a model, in every method: the importer gets `fmi2Fatal` or `fmi3Fatal` and a message, and its process and its
//! other instances continue.
#![allow(missing_docs)]

use fmu_test_kit::models;

mod calls;

use calls::{Case, Special, of_both, set_panic};
use fmu_export::Interface::{self, CoSimulation, ModelExchange};
use fmu_export::Status;
use fmu_test_kit::{Arguments, Either, Importer, fmi3};
use models::Faulty;
use models::faulty::{Name, Panic, while_all_break};
use std::ptr::null_mut;

const U: u32 = Name::u as u32;
const Y: u32 = Name::y as u32;
const X: u32 = Name::x as u32;
const BOOLEAN: u32 = Name::boolean as u32;
const STRING: u32 = Name::string as u32;
const PANIC: u32 = Name::panic as u32;

fn initialized<F: Either>(interface: Interface) -> F {
    let fmu = F::new::<Faulty>(interface);
    fmu.initialize(0.0);
    fmu
}

/// Asserts that the call is fatal and logs one message about it; returns the message.
#[track_caller]
fn fatal<F: Either>(fmu: &F, label: &str, call: impl FnOnce(&F) -> Status) -> String {
    fmu.take_log();
    let status = without_output(|| call(fmu));
    let log = fmu.take_log();
    assert_eq!(status, Status::Fatal, "{label}: {log:?}");
    assert_eq!(log.len(), 1, "{label}: {log:?}");
    log[0].assert_clean();
    assert_eq!((log[0].status, log[0].category.as_str()), (Status::Fatal, "logStatusFatal"), "{label}");
    log[0].message.clone()
}

/// Returns whether the model already panics in the call that sets the parameter.
fn occurs_when_set(panic: Panic) -> bool {
    [Panic::Update, Panic::Log].contains(&panic)
}

/// Checks both FMI versions in one test, because Rust's output about panics can only be disabled for the whole process.
#[test]
fn every_panic_is_contained() {
    contained::<Importer>();
    contained::<fmi3::Importer>();
}

/// Returns the name of a function with the prefix of its FMI version.
fn named<F: Either>(name: &str) -> String {
    format!("{}{name}", &F::functions()[0][..4])
}

fn contained<F: Special>() {
    let bystanders: [F; 2] = [CoSimulation, ModelExchange].map(initialized);
    let all = of_both::<F>().into_iter().chain(F::CALLS.iter().copied());
    all.for_each(|case| is_contained(case, &bystanders));

    let fmu = F::new::<Faulty>(CoSimulation);
    fmu.ok(set_panic(&fmu, Panic::Initialize));
    let message = fatal(&fmu, "initialization", |fmu| fmu.enter_initialization_mode(0.0, None));
    assert!(message.starts_with(&named::<F>("EnterInitializationMode")), "{message}");
    check_that_all_is_over(&fmu);

    let fmu: F = initialized(ModelExchange);
    fmu.ok(set_panic(&fmu, Panic::ContinuousTimeEntered));
    let message = fatal(&fmu, "continuous time", F::enter_continuous_time_mode);
    assert!(message.starts_with(&named::<F>("EnterContinuousTimeMode")), "{message}");
    check_that_all_is_over(&fmu);

    // Freeing an instance succeeds even if the model panics while the instance or one of its remaining states is dropped.
    let fmu = F::new::<Faulty>(CoSimulation);
    fmu.ok(set_panic(&fmu, Panic::Drop));
    (0..3).for_each(|_| _ = fmu.save());
    without_output(|| drop(fmu));

    // A panic while an instance is reset or created is reported.
    let fmu = F::new::<Faulty>(CoSimulation);
    fatal(&fmu, "reset", |fmu| while_all_break(Panic::New, || fmu.reset()));
    check_that_all_is_over(&fmu);
    let none = || F::make::<Faulty>(&Arguments::new::<Faulty>(CoSimulation)).map(drop);
    let log = without_output(|| while_all_break(Panic::New, none))
        .expect_err("the instantiation must fail if the model panics");
    let [message] = log.as_slice() else {
        panic!("expected one message about the panic of an instantiation: {log:?}")
    };
    assert!(message.message.starts_with(&named::<F>("Instantiate")), "{message:?}");
    assert!(message.message.contains("panic _New at 100_s"), "{message:?}");

    let [co_simulation, model_exchange] = &bystanders;
    co_simulation.step(0.0, 0.1);
    model_exchange.ok(model_exchange.enter_continuous_time_mode());
    assert_eq!([co_simulation.take_log(), model_exchange.take_log()], [vec![], vec![]]);
}

/// Asserts that the call is fatal for its instance and leaves the `bystanders`, two other instances, usable.
fn is_contained<F: Either>((interface, names, panic, call): Case<F>, bystanders: &[F; 2]) {
    let name = named::<F>(names[usize::from(named::<F>("") == "fmi3")]);
    let fmu: F = initialized(interface);
    if !occurs_when_set(panic) {
        fmu.ok(set_panic(&fmu, panic));
    }
    if interface == ModelExchange {
        fmu.ok(fmu.enter_continuous_time_mode());
    }
    let message = fatal(&fmu, &name, call);
    let reason = match panic {
        Panic::NoMessage | Panic::Bomb => "no message".into(),
        Panic::None => "panic _Clone at 100_s".into(),
        panic => format!("panic _{panic:?} at 100_s"),
    };
    assert!(message.starts_with(&name) && message.contains(&reason), "{message}");
    check_that_all_is_over(&fmu);
    without_output(|| drop(fmu));
    for bystander in bystanders {
        assert_eq!(bystander.get([Y]), [0.5], "{name}");
    }
}

/// Tests the library that `FMU_LIBRARY` names, which was compiled from the C sources of the model (`make test-source-fmu`).
/// Cases with `Panic::None` are left out: they call [`while_all_break`], which has no effect in that library. There,
/// `GetFMUstate` already visits the field `memory` and panics, so one case of it replaces the cases with `Panic::Memory`.
/// Cases with `Panic::Drop` are left out: in that library, a panic ends `FreeFMUstate` before it sets the importer's
/// pointer to NULL.
#[test]
#[ignore = "needs compiled C sources"]
fn every_panic_of_c_sources_is_contained() {
    assert!(std::env::var_os("FMU_LIBRARY").is_some(), "FMU_LIBRARY must name the compiled sources");
    let on_a_thread = || {
        let bystanders: [Importer; 2] = [CoSimulation, ModelExchange].map(initialized);
        let all = of_both::<Importer>().into_iter().chain(Importer::CALLS.iter().copied());
        let possible =
            |(_, _, panic, _): &Case<_>| ![Panic::None, Panic::Drop, Panic::Memory].contains(panic);
        let saving: Case<Importer> =
            (CoSimulation, ["GetFMUstate", ""], Panic::Memory, |fmu| fmu.get_state(&mut null_mut()));
        let calls: Vec<_> = all.filter(possible).chain([saving]).collect();
        assert!(calls.len() > 20);
        calls.into_iter().for_each(|case| is_contained(case, &bystanders));
        bystanders[0].step(0.0, 0.1);
    };
    std::thread::scope(|scope| (0..4).for_each(|_| _ = scope.spawn(on_a_thread)));
}

/// Runs the work without Rust's output about panics.
fn without_output<T>(work: impl FnOnce() -> T) -> T {
    std::panic::set_hook(Box::new(|_| {}));
    let result = work();
    let _ = std::panic::take_hook();
    result
}

/// Asserts that every function returns fatal and logs a message after a panic. The instance can then only be freed.
fn check_that_all_is_over<F: Either>(fmu: &F) {
    let statuses = fmu.call_all();
    let log = fmu.take_log();
    assert_eq!(statuses.len(), log.len());
    for ((name, status), message) in statuses.iter().zip(&log) {
        assert_eq!((*status, message.status), (Status::Fatal, Status::Fatal), "{name}");
        assert!(message.message.starts_with(name) && message.message.contains("fatal"), "{message:?}");
        assert_eq!(message.category, "logStatusFatal");
    }
}
