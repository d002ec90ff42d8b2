//! A model whose every method can panic: the importer gets `fmi2Fatal` and a message, and its process,
//! its other instances and its memory are safe.

mod support;

use fmi2_export::Interface::CoSimulation;
use fmi2_export::{
    BaseUnit, DefaultExperiment, Interface, Kind, Model, ModelError, ModelInfo, RealType, StateVisitor, Unit,
    Variable, export_fmi2, variables,
};
use std::cell::Cell;
use std::ffi::CStr;
use std::ptr::null_mut;
use support::{Arguments, Fmu, Status, assert_clean, call_all};

const NO_UNIT: Unit = Unit { name: "1", base: BaseUnit { kg: 0, m: 0, s: 0, rad: 0 }, display: None };
const NUMBER: RealType =
    RealType { name: "Number", quantity: "", unit: &NO_UNIT, min: None, max: None, nominal: None };

variables! {
    /// What comes in
    u = Variable::input(&NUMBER, 0.0);
    /// What goes out
    y = Variable::output(&NUMBER);
    /// Which method panics
    fault = Variable::parameter(Kind::Integer { min: 0, max: 99, start: 0 });
}

/// Breaks in the method of this number.
#[derive(Clone)]
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

thread_local! {
    /// Lets new instances panic.
    static NEW_PANICS: Cell<bool> = const { Cell::new(false) };
}

impl Faulty {
    fn panic_if(&self, fault: i32) {
        assert!(self.fault != fault, "fault #{fault} at 100%s");
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
        name: "Faulty",
        identifier: "faulty",
        guid: "{faulty}",
        description: "Breaks where it is told to",
        author: "",
        version: "1",
        license: "",
        copyright: "",
        default_experiment: DefaultExperiment {
            start_time: 0.0,
            stop_time: 1.0,
            step_size: 0.1,
            tolerance: 1e-6,
        },
        variables: VARIABLES,
        co_simulation: Some(fmi2_export::CoSimulation {
            variable_step_size: true,
            interpolates_inputs: true,
            max_output_derivative_order: 1,
            directional_derivative: true,
            serializes_state: true,
        }),
        model_exchange: None,
    };

    fn new(_interface: Interface) -> Self {
        assert!(!NEW_PANICS.get(), "no new instance today");
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
        self.fault
    }

    fn set_integer(&mut self, _vr: u32, value: i32) {
        self.fault = value;
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

/// Runs the call, which must be fatal, with one message about it; what Rust prints about the panic
/// stays out of the test's output.
#[track_caller]
fn fatal(fmu: &Fmu, label: &str, call: impl FnOnce(&Fmu) -> Status) -> String {
    fmu.take_log();
    std::panic::set_hook(Box::new(|_| {}));
    let status = call(fmu);
    let _ = std::panic::take_hook();
    let log = fmu.take_log();
    assert_eq!(status, Status::Fatal, "{label}: {log:?}");
    assert_eq!(log.len(), 1, "{label}: {log:?}");
    assert_clean(&log[0]);
    assert_eq!((log[0].status, log[0].category.as_str()), (Status::Fatal, "logStatusFatal"), "{label}");
    log[0].text.clone()
}

/// One test, because what Rust prints about panics is switched off for the whole process.
#[test]
fn every_panic_is_contained() {
    type Call = fn(&Fmu) -> Status;
    let cases: &[(&str, i32, Call)] = &[
        ("fmi2GetReal", REAL, |fmu| fmu.fmi2GetReal(&vr::y, 1, &mut 0.0)),
        ("fmi2GetReal", ODD_PAYLOAD, |fmu| fmu.fmi2GetReal(&vr::y, 1, &mut 0.0)),
        ("fmi2SetReal", SET_REAL, |fmu| fmu.try_set(&[vr::u], &[1.0])),
        ("fmi2DoStep", DO_STEP, |fmu| fmu.try_step(0.0, 0.1)),
        ("fmi2SetRealInputDerivatives", SET_INPUT_DERIVATIVE, |fmu| {
            fmu.fmi2SetRealInputDerivatives(&vr::u, 1, &1, &1.0)
        }),
        ("fmi2GetRealOutputDerivatives", OUTPUT_DERIVATIVE, |fmu| {
            fmu.fmi2GetRealOutputDerivatives(&vr::y, 1, &1, &mut 0.0)
        }),
        ("fmi2GetDirectionalDerivative", PARTIAL_DERIVATIVE, |fmu| {
            fmu.fmi2GetDirectionalDerivative(&vr::y, 1, &vr::u, 1, &1.0, &mut 0.0)
        }),
        ("fmi2SerializedFMUstateSize", VISIT_STATE, |fmu| {
            let mut state = null_mut();
            fmu.ok(fmu.fmi2GetFMUstate(&mut state));
            let status = fmu.fmi2SerializedFMUstateSize(state, &mut 0);
            let helper = Fmu::new(CoSimulation);
            helper.forget(state);
            status
        }),
    ];
    let bystander = Fmu::new(CoSimulation);
    bystander.initialize(0.0);
    for (name, fault, call) in cases {
        let fmu = Fmu::new(CoSimulation);
        fmu.initialize(0.0);
        fmu.ok(set_fault(&fmu, *fault));
        let message = fatal(&fmu, name, call);
        let reason =
            if *fault == ODD_PAYLOAD { "no message".into() } else { format!("fault _{fault} at 100_s") };
        assert!(message.starts_with(name) && message.contains(&reason), "{message}");
        check_that_all_is_over(&fmu);
        assert_eq!(bystander.get([vr::y]), [0.5], "{name}");
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
    std::panic::set_hook(Box::new(|_| {}));
    drop(fmu);

    // A panic while one is made, for the first time and by a reset.
    let fmu = Fmu::new(CoSimulation);
    NEW_PANICS.set(true);
    let log = Fmu::instantiate(&Arguments::new(CoSimulation)).err().expect("no instance comes of a panic");
    assert!(fmu.fmi2Reset() == Status::Fatal && fmu.take_log().len() == 1);
    NEW_PANICS.set(false);
    let _ = std::panic::take_hook();
    assert_eq!(log.len(), 1, "a message about a panic in fmi2Instantiate: {log:?}");
    assert!(log[0].text.contains("no new instance today"), "{log:?}");

    bystander.step(0.0, 0.1);
    assert_eq!(bystander.take_log(), []);
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
