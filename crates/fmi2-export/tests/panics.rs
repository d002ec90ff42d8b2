//! A model whose every method can panic: the importer gets `fmi2Fatal` and a message, and its process,
//! its other instances and its memory are safe.

mod support;

use fmi2_export::Interface::{CoSimulation, ModelExchange};
use fmi2_export::{
    Interface, Kind, Model, ModelError, ModelInfo, RealType, StateVisitor, Variable, export_fmi2, units,
    variables,
};
use std::cell::Cell;
use std::ffi::{CStr, c_void};
use std::ptr::null_mut;
use support::{Arguments, Fmu, Status, assert_clean, call_all};

const NUMBER: RealType = RealType::new("Number", &units::ONE);

variables! {
    /// What comes in
    u = Variable::input(&NUMBER, 0.0);
    /// What goes out
    y = Variable::output(&NUMBER);
    /// Which method panics
    fault = Variable::parameter(Kind::Integer { min: 0, max: 99, start: 0 });
    /// A truth
    flag = Variable::parameter(Kind::Boolean { start: false });
    /// A state
    x = Variable::local(&NUMBER).state(0.0);
    /// Its rate
    der_x = Variable::local(&NUMBER).derivative_of(vr::x).named("der(x)");
}

/// Breaks in the method of this number.
struct Faulty {
    fault: i32,
}

const REAL: i32 = 1;
const SET_REAL: i32 = 2;
const PARAMETERS_CHANGED: i32 = 3;
const INITIALIZE: i32 = 4;
const DO_STEP: i32 = 5;
const SET_INPUT_DERIVATIVE: i32 = 6;
const OUTPUT_DERIVATIVE: i32 = 7;
const PARTIAL_DERIVATIVE: i32 = 8;
const VISIT_STATE: i32 = 9;
const DROP: i32 = 10;
const ODD_PAYLOAD: i32 = 11;

const SET_TIME: i32 = 12;
const INTEGER: i32 = 13;
const SET_INTEGER: i32 = 14;
const BOOLEAN: i32 = 15;
const SET_BOOLEAN: i32 = 16;
const NEW: i32 = 17;
const CLONE: i32 = 18;

thread_local! {
    /// Breaks every new instance or every copy, whatever their own fault.
    static FAULT: Cell<i32> = const { Cell::new(0) };
}

impl Faulty {
    fn panic_if(&self, fault: i32) {
        assert!(self.fault != fault, "fault #{fault} at 100%s");
    }
}

impl Clone for Faulty {
    fn clone(&self) -> Self {
        Self { fault: FAULT.get() }.panic_if(CLONE);
        Self { fault: self.fault }
    }
}

impl Drop for Faulty {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.panic_if(DROP);
        }
    }
}

impl Model for Faulty {
    const INFO: ModelInfo = ModelInfo {
        co_simulation: Some(fmi2_export::CoSimulation {
            variable_step_size: true,
            interpolates_inputs: true,
            max_output_derivative_order: 1,
            directional_derivative: true,
            serializes_state: true,
        }),
        model_exchange: Some(fmi2_export::ModelExchange {
            directional_derivative: true,
            serializes_state: true,
        }),
        ..ModelInfo::new("Faulty", "faulty", "{faulty}", VARIABLES)
    };

    fn new(_interface: Interface) -> Self {
        Self { fault: FAULT.get() }.panic_if(NEW);
        Self { fault: 0 }
    }

    fn real(&self, _vr: u32) -> f64 {
        self.panic_if(REAL);
        if self.fault == ODD_PAYLOAD {
            std::panic::panic_any(7);
        }
        0.5
    }

    fn set_real(&mut self, _vr: u32, _value: f64) {
        self.panic_if(SET_REAL);
    }

    fn integer(&self, _vr: u32) -> i32 {
        self.panic_if(INTEGER);
        self.fault
    }

    fn set_integer(&mut self, _vr: u32, value: i32) {
        self.panic_if(SET_INTEGER);
        self.fault = value;
    }

    fn boolean(&self, _vr: u32) -> bool {
        self.panic_if(BOOLEAN);
        false
    }

    fn set_boolean(&mut self, _vr: u32, _value: bool) {
        self.panic_if(SET_BOOLEAN);
    }

    fn parameters_changed(&mut self) -> Result<(), ModelError> {
        self.panic_if(PARAMETERS_CHANGED);
        Ok(())
    }

    fn initialize(&mut self, _start_time: f64) -> Result<(), ModelError> {
        self.panic_if(INITIALIZE);
        Ok(())
    }

    fn do_step(&mut self, _time: f64, _step_size: f64) -> Result<(), ModelError> {
        self.panic_if(DO_STEP);
        Ok(())
    }

    fn set_time(&mut self, _time: f64) {
        self.panic_if(SET_TIME);
    }

    fn set_input_derivative(&mut self, _vr: u32, _order: u32, _value: f64) {
        self.panic_if(SET_INPUT_DERIVATIVE);
    }

    fn output_derivative(&self, _vr: u32, _order: u32) -> f64 {
        self.panic_if(OUTPUT_DERIVATIVE);
        0.0
    }

    fn partial_derivative(&self, _unknown: u32, _known: u32) -> Option<f64> {
        self.panic_if(PARTIAL_DERIVATIVE);
        Some(1.0)
    }

    fn visit_state(&mut self, visitor: &mut impl StateVisitor) {
        self.panic_if(VISIT_STATE);
        visitor.integer(&mut self.fault);
    }
}

export_fmi2!(Faulty);

const GUID: &CStr = c"{faulty}";

fn set_fault(fmu: &Fmu, fault: i32) -> Status {
    fmu.fmi2SetInteger(&vr::fault, 1, &fault)
}

/// Runs the call, which must be fatal, with one message about it.
#[track_caller]
fn fatal(fmu: &Fmu, label: &str, call: impl FnOnce(&Fmu) -> Status) -> String {
    fmu.take_log();
    let status = without_output(|| call(fmu));
    let log = fmu.take_log();
    assert_eq!(status, Status::Fatal, "{label}: {log:?}");
    assert_eq!(log.len(), 1, "{label}: {log:?}");
    assert_clean(&log[0]);
    assert_eq!((log[0].status, log[0].category.as_str()), (Status::Fatal, "logStatusFatal"), "{label}");
    log[0].text.clone()
}

/// Runs the work while every new instance or copy breaks.
fn while_all_break<T>(fault: i32, work: impl FnOnce() -> T) -> T {
    FAULT.set(fault);
    let result = work();
    FAULT.set(0);
    result
}

/// Runs the function on a saved state of the instance.
fn with_state(fmu: &Fmu, function: impl FnOnce(&mut *mut c_void) -> Status) -> Status {
    let mut state = fmu.save();
    let status = function(&mut state);
    Fmu::new(CoSimulation).forget(state);
    status
}

type Call = fn(&Fmu) -> Status;

/// A call that breaks an instance with this fault: every function that runs a model's code.
const CALLS: &[(Interface, &str, i32, Call)] = &[
    (CoSimulation, "fmi2GetReal", REAL, |fmu| fmu.fmi2GetReal(&vr::y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetReal", ODD_PAYLOAD, |fmu| fmu.fmi2GetReal(&vr::y, 1, &mut 0.0)),
    (CoSimulation, "fmi2GetInteger", INTEGER, |fmu| fmu.fmi2GetInteger(&vr::fault, 1, &mut 0)),
    (CoSimulation, "fmi2GetBoolean", BOOLEAN, |fmu| fmu.fmi2GetBoolean(&vr::flag, 1, &mut 0)),
    (CoSimulation, "fmi2SetReal", SET_REAL, |fmu| fmu.try_set(&[vr::u], &[1.0])),
    (CoSimulation, "fmi2SetInteger", SET_INTEGER, |fmu| set_fault(fmu, 0)),
    (CoSimulation, "fmi2SetBoolean", SET_BOOLEAN, |fmu| fmu.fmi2SetBoolean(&vr::flag, 1, &1)),
    (CoSimulation, "fmi2SetBoolean", 0, |fmu| {
        while_all_break(CLONE, || fmu.fmi2SetBoolean(&vr::flag, 1, &1))
    }),
    (CoSimulation, "fmi2DoStep", DO_STEP, |fmu| fmu.try_step(0.0, 0.1)),
    (CoSimulation, "fmi2SetRealInputDerivatives", SET_INPUT_DERIVATIVE, |fmu| {
        fmu.fmi2SetRealInputDerivatives(&vr::u, 1, &1, &1.0)
    }),
    (CoSimulation, "fmi2GetRealOutputDerivatives", OUTPUT_DERIVATIVE, |fmu| {
        fmu.fmi2GetRealOutputDerivatives(&vr::y, 1, &1, &mut 0.0)
    }),
    (CoSimulation, "fmi2GetDirectionalDerivative", PARTIAL_DERIVATIVE, |fmu| {
        fmu.fmi2GetDirectionalDerivative(&vr::y, 1, &vr::u, 1, &1.0, &mut 0.0)
    }),
    (ModelExchange, "fmi2SetTime", SET_TIME, |fmu| fmu.fmi2SetTime(1.0)),
    (ModelExchange, "fmi2GetDerivatives", REAL, |fmu| fmu.fmi2GetDerivatives(&mut 0.0, 1)),
    (ModelExchange, "fmi2GetContinuousStates", REAL, |fmu| fmu.fmi2GetContinuousStates(&mut 0.0, 1)),
    (ModelExchange, "fmi2SetContinuousStates", SET_REAL, |fmu| fmu.fmi2SetContinuousStates(&0.0, 1)),
    (CoSimulation, "fmi2GetFMUstate", 0, |fmu| {
        let mut state = null_mut();
        let status = while_all_break(CLONE, || fmu.fmi2GetFMUstate(&mut state));
        assert!(state.is_null());
        status
    }),
    (CoSimulation, "fmi2GetFMUstate", 0, |fmu| {
        with_state(fmu, |state| while_all_break(CLONE, || fmu.fmi2GetFMUstate(state)))
    }),
    (CoSimulation, "fmi2SetFMUstate", 0, |fmu| {
        with_state(fmu, |state| while_all_break(CLONE, || fmu.fmi2SetFMUstate(*state)))
    }),
    (CoSimulation, "fmi2FreeFMUstate", DROP, |fmu| {
        with_state(fmu, |state| {
            let status = fmu.fmi2FreeFMUstate(state);
            assert!(state.is_null());
            status
        })
    }),
    (CoSimulation, "fmi2SerializedFMUstateSize", VISIT_STATE, |fmu| {
        with_state(fmu, |state| fmu.fmi2SerializedFMUstateSize(*state, &mut 0))
    }),
    (CoSimulation, "fmi2SerializeFMUstate", VISIT_STATE, |fmu| {
        with_state(fmu, |state| fmu.fmi2SerializeFMUstate(*state, [0; 100].as_mut_ptr(), 100))
    }),
    (CoSimulation, "fmi2DeSerializeFMUstate", VISIT_STATE, |fmu| {
        let bytes = Fmu::new(CoSimulation).bytes();
        let mut state = null_mut();
        let status = fmu.fmi2DeSerializeFMUstate(bytes.as_ptr().cast(), bytes.len(), &mut state);
        assert!(state.is_null());
        status
    }),
];

/// One test, because what Rust prints about panics is switched off for the whole process.
#[test]
fn every_panic_is_contained() {
    let bystanders = [CoSimulation, ModelExchange].map(Fmu::new);
    for bystander in &bystanders {
        bystander.initialize(0.0);
    }
    for (interface, name, fault, call) in CALLS {
        let fmu = Fmu::new(*interface);
        fmu.initialize(0.0);
        fmu.ok(set_fault(&fmu, *fault));
        let message = fatal(&fmu, name, call);
        let reason = match *fault {
            ODD_PAYLOAD => "no message".into(),
            0 => format!("fault _{CLONE} at 100_s"),
            fault => format!("fault _{fault} at 100_s"),
        };
        assert!(message.starts_with(name) && message.contains(&reason), "{message}");
        check_that_all_is_over(&fmu);
        without_output(|| drop(fmu));
        for bystander in &bystanders {
            assert_eq!(bystander.get([vr::y]), [0.5], "{name}");
        }
    }

    let fmu = Fmu::new(CoSimulation);
    fatal(&fmu, "fmi2SetInteger", |fmu| set_fault(fmu, PARAMETERS_CHANGED));
    check_that_all_is_over(&fmu);

    let fmu = Fmu::new(CoSimulation);
    fmu.ok(set_fault(&fmu, INITIALIZE));
    fatal(&fmu, "fmi2EnterInitializationMode", |fmu| fmu.fmi2EnterInitializationMode());
    check_that_all_is_over(&fmu);

    // A panic while an instance is freed ends with it.
    let fmu = Fmu::new(CoSimulation);
    fmu.ok(set_fault(&fmu, DROP));
    without_output(|| drop(fmu));

    // A panic while one is made, for the first time and by a reset.
    let fmu = Fmu::new(CoSimulation);
    fatal(&fmu, "fmi2Reset", |fmu| while_all_break(NEW, || fmu.fmi2Reset()));
    check_that_all_is_over(&fmu);
    let none = || Fmu::instantiate(&Arguments::new(CoSimulation));
    let log = without_output(|| while_all_break(NEW, none)).err().expect("no instance comes of a panic");
    assert_eq!(log.len(), 1, "a message about a panic in fmi2Instantiate: {log:?}");
    assert!(log[0].text.contains("fault _17 at 100_s"), "{log:?}");

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

/// After a panic every function is fatal and says so; only freeing is left, which the end of the test
/// does.
fn check_that_all_is_over(fmu: &Fmu) {
    let answers = call_all(fmu);
    let log = fmu.take_log();
    assert_eq!((answers.len(), log.len()), (40, 40));
    for ((name, status), message) in answers.iter().zip(&log) {
        assert_eq!((*status, message.status), (Status::Fatal, Status::Fatal), "{name}");
        assert!(message.text.starts_with(name) && message.text.contains("fatal"), "{message:?}");
        assert_eq!(message.category, "logStatusFatal");
    }
}
