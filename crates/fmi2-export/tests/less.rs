//! A model that offers less than everything: the FMU refuses what it does not have, in words, and the
//! rest works.

mod support;

use fmi2_export::Interface::{CoSimulation, ModelExchange};
use fmi2_export::types::fmi2FMUstate;
use fmi2_export::{
    Interface, Kind, Model, ModelError, ModelInfo, RealType, Variable, export_fmi2, units, variables,
};
use std::ffi::CStr;
use std::ptr::null_mut;
use support::{Arguments, Fmu, Status};

const NUMBER: RealType = RealType { min: Some(0.0), max: Some(10.0), ..RealType::new("Number", &units::ONE) };

variables! {
    /// What comes in
    u = Variable::input(&NUMBER, 0.0);
    /// What goes out: the sum of all that came in
    y = Variable::output(&NUMBER);
    /// Factor
    gain = Variable::parameter(Kind::Real { of: &NUMBER, start: 1.0 });
}

/// Sums up its input. No Model Exchange, no derivatives of any kind, no serialized states.
#[derive(Clone)]
struct Sum {
    u: f64,
    y: f64,
    gain: f64,
}

impl Model for Sum {
    const INFO: ModelInfo = ModelInfo {
        co_simulation: Some(fmi2_export::CoSimulation {
            variable_step_size: true,
            interpolates_inputs: false,
            max_output_derivative_order: 0,
            directional_derivative: false,
            serializes_state: false,
        }),
        ..ModelInfo::new("Sum", "sum", "{sum}", VARIABLES)
    };

    fn new(_interface: Interface) -> Self {
        Self { u: 0.0, y: 0.0, gain: 1.0 }
    }

    fn real(&self, vr: u32) -> f64 {
        [self.u, self.y, self.gain][vr as usize]
    }

    fn set_real(&mut self, vr: u32, value: f64) {
        *(if vr == vr::u { &mut self.u } else { &mut self.gain }) = value;
    }

    fn initialize(&mut self, start_time: f64) -> Result<(), ModelError> {
        if start_time < 0.0 {
            return Err(ModelError::new("this model knows no time before 0"));
        }
        Ok(())
    }

    fn do_step(&mut self, _time: f64, _step_size: f64) -> Result<(), ModelError> {
        if self.y + self.gain * self.u > 10.0 {
            return Err(ModelError::new("the sum would be more than 10"));
        }
        self.y += self.gain * self.u;
        Ok(())
    }
}

export_fmi2!(Sum);

const GUID: &CStr = c"{sum}";

fn running() -> Fmu {
    let fmu = Fmu::new(CoSimulation);
    fmu.set(&[vr::gain], &[2.0]);
    fmu.initialize(0.0);
    fmu.set(&[vr::u], &[1.5]);
    fmu.step(0.0, 1.0);
    fmu
}

#[test]
fn what_it_has_works() {
    let fmu = running();
    assert_eq!(fmu.get([vr::u, vr::y, vr::gain]), [1.5, 3.0, 2.0]);
    let state = fmu.save();
    fmu.step(1.0, 0.5);
    assert_eq!(fmu.get([vr::y]), [6.0]);
    fmu.ok(fmu.fmi2SetFMUstate(state));
    assert_eq!(fmu.get([vr::y]), [3.0]);
    fmu.step(1.0, 0.5);
    fmu.forget(state);
    fmu.ok(fmu.fmi2Terminate());
    fmu.ok(fmu.fmi2Reset());
    fmu.initialize(0.0);
    assert_eq!(fmu.get([vr::u, vr::y, vr::gain]), [0.0, 0.0, 1.0]);
}

#[test]
fn no_model_exchange() {
    let log = Fmu::instantiate(&Arguments::new(ModelExchange)).err().expect("there is no Model Exchange");
    assert_eq!(log.len(), 1);
    assert!(log[0].text.contains("no Model Exchange"), "{log:?}");
}

/// What the FMU does not offer, and the attribute of its description that says so.
#[test]
fn what_it_lacks_is_refused() {
    let fmu = running();
    let state = fmu.save();
    let mut bytes = [0; 64];
    let (mut restored, mut size): (fmi2FMUstate, _) = (null_mut(), 0);
    let calls: &mut [(&str, &mut dyn FnMut() -> Status)] = &mut [
        ("providesDirectionalDerivative", &mut || {
            fmu.fmi2GetDirectionalDerivative(&vr::y, 1, &vr::u, 1, &1.0, &mut 0.0)
        }),
        ("canInterpolateInputs", &mut || fmu.fmi2SetRealInputDerivatives(&vr::u, 1, &1, &1.0)),
        ("maxOutputDerivativeOrder", &mut || fmu.fmi2GetRealOutputDerivatives(&vr::y, 1, &1, &mut 0.0)),
        ("canSerializeFMUstate", &mut || fmu.fmi2SerializedFMUstateSize(state, &mut size)),
        ("canSerializeFMUstate", &mut || fmu.fmi2SerializeFMUstate(state, bytes.as_mut_ptr(), 64)),
        ("canSerializeFMUstate", &mut || fmu.fmi2DeSerializeFMUstate([0; 64].as_ptr(), 64, &mut restored)),
    ];
    for (attribute, call) in calls {
        let message = fmu.refused(attribute, |_| call());
        assert!(message.contains(*attribute), "{message}");
    }
    assert!(restored.is_null() && size == 0 && bytes == [0; 64]);
    assert_eq!(fmu.get([vr::u, vr::y]), [1.5, 3.0]);
    fmu.forget(state);
}

/// What the model itself refuses comes back as its words, and the step can be repeated.
#[test]
fn errors_of_the_model() {
    let fmu = Fmu::new(CoSimulation);
    fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, -1.0, 0, 0.0));
    let message = fmu.refused("start time", |fmu| fmu.fmi2EnterInitializationMode());
    assert!(message.contains("no time before 0"), "{message}");
    fmu.initialize(0.0);
    fmu.set(&[vr::u], &[9.0]);
    fmu.step(0.0, 1.0);
    let message = fmu.refused("sum", |fmu| fmu.try_step(1.0, 1.0));
    assert!(message.contains("more than 10"), "{message}");
    fmu.set(&[vr::u], &[1.0]);
    fmu.step(1.0, 1.0);
    assert_eq!(fmu.get([vr::y]), [10.0]);
}

/// The range of a parameter's type is enforced, that of an input is a hint.
#[test]
fn ranges() {
    let fmu = Fmu::new(CoSimulation);
    for (value, word) in [(10.5, "above 10"), (-0.5, "below 0")] {
        let message = fmu.refused("gain", |fmu| fmu.try_set(&[vr::gain], &[value]));
        assert!(message.contains("gain") && message.contains(word), "{message}");
        fmu.set(&[vr::u], &[value]);
    }
    fmu.set(&[vr::gain], &[10.0]);
}
