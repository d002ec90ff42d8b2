//! A model whose every method can panic: the importer gets `fmi2Fatal` or `fmi3Fatal` and a message, and its process, its
//! other instances and its memory are safe.
#![allow(missing_docs)]

#[path = "../toys/mod.rs"]
mod toys;

mod fmi2;
mod fmi3;

use fmu_export::Interface::{self, CoSimulation, ModelExchange};
use fmu_export::Status;
use fmu_export::fmi3::reference;
use fmu_test_kit::Message;
use fmu_test_kit::testing::assert_clean;
use fmu_test_kit::{self as old, fmi3 as new};
use std::ffi::c_void;
use toys::Faulty;
use toys::faulty::{Fault, Name, while_all_break};

const U: u32 = Name::u as u32;
const Y: u32 = Name::y as u32;
const X: u32 = Name::x as u32;
const TRUTH: u32 = Name::truth as u32;
const TEXT: u32 = Name::text as u32;
const FAULT: u32 = Name::fault as u32;

/// A call that breaks an instance of this interface type with this fault, and its name.
type Case<F> = (Interface, &'static str, Fault, fn(&F) -> Status);

/// What both standards have under different names.
trait Standard: Sized + 'static {
    /// Every function that runs a model's code.
    const CALLS: &'static [Case<Self>];
    /// How many functions work on an instance.
    const FUNCTIONS: usize;
    const PREFIX: &'static str;

    fn try_new(interface: Interface) -> Result<Self, Vec<Message>>;
    fn set_fault(&self, fault: Fault) -> Status;
    fn enter_initialization_mode(&self) -> Status;
    fn enter_continuous_time_mode(&self) -> Status;
    fn start(&self);
    fn go_on(&self);
    fn reset(&self) -> Status;
    fn y(&self) -> f64;
    fn messages(&self) -> Vec<Message>;
    fn with_zeros(&self) -> Vec<(&'static str, Status)>;
    fn saved(&self) -> *mut c_void;

    fn new(interface: Interface) -> Self {
        Self::try_new(interface).expect("an instance")
    }
}

macro_rules! standard {
    (
        $importer:ident of $module:ident, $standard:ident, $calls:path, $functions:literal, $prefix:literal, |$fmu:ident, $fault:ident|
        $set_fault:expr, $initialize:expr, $continuous:ident, $reset:ident
    ) => {
        impl Standard for $module::$importer {
            const CALLS: &'static [Case<Self>] = $calls;
            const FUNCTIONS: usize = $functions;
            const PREFIX: &'static str = $prefix;

            fn try_new(interface: Interface) -> Result<Self, Vec<Message>> {
                Self::instantiate(
                    fmu_export::$standard::functions::<Faulty>(),
                    &$module::Arguments::of::<Faulty>(interface),
                )
            }
            fn set_fault(&self, $fault: Fault) -> Status {
                let $fmu = self;
                $set_fault
            }
            fn enter_initialization_mode(&self) -> Status {
                let $fmu = self;
                $initialize
            }
            fn enter_continuous_time_mode(&self) -> Status {
                self.$continuous()
            }
            fn start(&self) {
                self.initialize(0.0);
            }
            fn go_on(&self) {
                self.step(0.0, 0.1);
            }
            fn reset(&self) -> Status {
                self.$reset()
            }
            fn y(&self) -> f64 {
                let [y] = self.get([Y]);
                y
            }
            fn messages(&self) -> Vec<Message> {
                self.take_log()
            }
            fn with_zeros(&self) -> Vec<(&'static str, Status)> {
                self.call_all()
            }
            fn saved(&self) -> *mut c_void {
                self.save()
            }
        }
    };
}

standard! {
    Importer of old, fmi2, fmi2::CALLS, 40, "fmi2", |fmu, fault|
    fmu.fmi2SetInteger(&FAULT, 1, &(fault as i32)),
    fmu.fmi2EnterInitializationMode(), fmi2EnterContinuousTimeMode, fmi2Reset
}
standard! {
    Importer of new, fmi3, fmi3::CALLS, 70, "fmi3", |fmu, fault|
    fmu.fmi3SetInt32(&reference(FAULT), 1, &(fault as i32), 1),
    fmu.fmi3EnterInitializationMode(0, 0.0, 0.0, 0, 0.0), fmi3EnterContinuousTimeMode, fmi3Reset
}

/// Runs the call, which must be fatal, with one message about it.
#[track_caller]
fn fatal<F: Standard>(fmu: &F, label: &str, call: impl FnOnce(&F) -> Status) -> String {
    fmu.messages();
    let status = without_output(|| call(fmu));
    let log = fmu.messages();
    assert_eq!(status, Status::Fatal, "{label}: {log:?}");
    assert_eq!(log.len(), 1, "{label}: {log:?}");
    assert_clean(&log[0]);
    assert_eq!((log[0].status, log[0].category.as_str()), (Status::Fatal, "logStatusFatal"), "{label}");
    log[0].text.clone()
}

/// Runs the function on a saved state of the instance.
fn with_state<F: Standard>(fmu: &F, function: impl FnOnce(&mut *mut c_void) -> Status) -> Status {
    function(&mut fmu.saved())
}

/// Faults that show as soon as the parameter says so: it is set by the call itself.
fn shows_at_once(fault: Fault) -> bool {
    [Fault::Update, Fault::Log].contains(&fault)
}

/// One test for both standards, because what Rust prints about panics is switched off for the whole process.
#[test]
fn every_panic_is_contained() {
    contained::<old::Importer>();
    contained::<new::Importer>();
}

fn contained<F: Standard>() {
    let named = |name: &str| format!("{}{name}", F::PREFIX);
    let bystanders = [CoSimulation, ModelExchange].map(F::new);
    bystanders.iter().for_each(F::start);
    each_call_is_contained(F::new, F::CALLS, &bystanders);

    let fmu = F::new(CoSimulation);
    assert_eq!(fmu.set_fault(Fault::Initialize), Status::Ok);
    let message = fatal(&fmu, "initialization", F::enter_initialization_mode);
    assert!(message.starts_with(&named("EnterInitializationMode")), "{message}");
    check_that_all_is_over(&fmu);

    let fmu = F::new(ModelExchange);
    fmu.start();
    assert_eq!(fmu.set_fault(Fault::ContinuousTimeEntered), Status::Ok);
    let message = fatal(&fmu, "continuous time", F::enter_continuous_time_mode);
    assert!(message.starts_with(&named("EnterContinuousTimeMode")), "{message}");
    check_that_all_is_over(&fmu);

    // A panic while an instance is freed ends with it; so do those of its states.
    let fmu = F::new(CoSimulation);
    assert_eq!(fmu.set_fault(Fault::Drop), Status::Ok);
    (0..3).for_each(|_| _ = fmu.saved());
    without_output(|| drop(fmu));

    // A panic while one is made, for the first time and by a reset.
    let fmu = F::new(CoSimulation);
    fatal(&fmu, "reset", |fmu| while_all_break(Fault::New, || fmu.reset()));
    check_that_all_is_over(&fmu);
    let none = || F::try_new(CoSimulation).map(drop);
    let log = without_output(|| while_all_break(Fault::New, none)).expect_err("no instance comes of a panic");
    let [message] = log.as_slice() else {
        panic!("a message about a panic while an instance is made: {log:?}")
    };
    assert!(message.text.starts_with(&named("Instantiate")), "{message:?}");
    assert!(message.text.contains("fault _New at 100_s"), "{message:?}");

    let [co_simulation, model_exchange] = &bystanders;
    co_simulation.go_on();
    assert_eq!(model_exchange.enter_continuous_time_mode(), Status::Ok);
    assert_eq!([co_simulation.messages(), model_exchange.messages()], [vec![], vec![]]);
}

/// Breaks an instance with each of the calls; `bystanders` do not notice.
fn each_call_is_contained<'a, F: Standard>(
    new: fn(Interface) -> F,
    calls: impl IntoIterator<Item = &'a Case<F>>,
    bystanders: &[F; 2],
) {
    for (interface, name, fault, call) in calls {
        let fmu = new(*interface);
        fmu.start();
        if !shows_at_once(*fault) {
            assert_eq!(fmu.set_fault(*fault), Status::Ok);
        }
        if *interface == ModelExchange {
            assert_eq!(fmu.enter_continuous_time_mode(), Status::Ok);
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
        for bystander in bystanders {
            assert_eq!(bystander.y(), 0.5, "{name}");
        }
    }
}

/// The model made into C sources, whose compiled library `FMU_LIBRARY` names: `make test-source-fmu`. What breaks every
/// instance at once does so in this program only, and a saved state belongs to its instance.
#[test]
#[ignore = "needs compiled C sources"]
fn every_panic_of_c_sources_is_contained() {
    assert!(std::env::var_os("FMU_LIBRARY").is_some(), "FMU_LIBRARY must name the compiled sources");
    let on_a_thread = || {
        let bystanders = [CoSimulation, ModelExchange].map(old::Importer::of::<Faulty>);
        bystanders.iter().for_each(Standard::start);
        let possible = |(_, _, fault, _): &&Case<_>| ![Fault::None, Fault::Drop].contains(fault);
        let calls: Vec<_> = old::Importer::CALLS.iter().filter(possible).collect();
        assert!(calls.len() > 20);
        each_call_is_contained(old::Importer::of::<Faulty>, calls, &bystanders);
        bystanders[0].go_on();
    };
    std::thread::scope(|scope| (0..4).for_each(|_| _ = scope.spawn(on_a_thread)));
}

/// What Rust prints about a panic stays out of the test's output.
fn without_output<T>(work: impl FnOnce() -> T) -> T {
    std::panic::set_hook(Box::new(|_| {}));
    let result = work();
    let _ = std::panic::take_hook();
    result
}

/// After a panic every function is fatal and says so; only freeing is left, which the end of the test does.
fn check_that_all_is_over<F: Standard>(fmu: &F) {
    let answers = fmu.with_zeros();
    let log = fmu.messages();
    assert_eq!((answers.len(), log.len()), (F::FUNCTIONS, F::FUNCTIONS));
    for ((name, status), message) in answers.iter().zip(&log) {
        assert_eq!((*status, message.status), (Status::Fatal, Status::Fatal), "{name}");
        assert!(message.text.starts_with(name) && message.text.contains("fatal"), "{message:?}");
        assert_eq!(message.category, "logStatusFatal");
    }
}
