//! Models with few capabilities: the FMU rejects missing ones with a message, and the rest works.

use crate::models::{Sum, sum::Name};
use fmu_export::Exported;
use fmu_export::Interface::{self, CoSimulation, ModelExchange};
use fmu_test_kit::{Arguments, Either, Importer};

const U: u32 = Name::u as u32;
const Y: u32 = Name::y as u32;
const GAIN: u32 = Name::gain as u32;

#[test]
fn what_it_has_works() {
    let fmu = Importer::of::<Sum>(CoSimulation);
    fmu.set(&[GAIN], &[2.0]);
    fmu.initialize(0.0);
    fmu.set(&[U], &[1.5]);
    fmu.step(0.0, 1.0);
    assert_eq!(fmu.get([U, Y, GAIN]), [1.5, 3.0, 2.0]);
    let state = fmu.save();
    fmu.step(1.0, 0.5);
    assert_eq!(fmu.get([Y]), [6.0]);
    fmu.ok(fmu.fmi2SetFMUstate(state));
    assert_eq!(fmu.get([Y]), [3.0]);
    fmu.step(1.0, 0.5);
    fmu.forget(state);
    fmu.ok(fmu.fmi2Terminate());
    fmu.ok(fmu.fmi2Reset());
    fmu.initialize(0.0);
    assert_eq!(fmu.get([U, Y, GAIN]), [0.0, 0.0, 1.0]);
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

fn refused_interface<M: Exported>(interface: Interface) -> String {
    let log = Importer::try_with::<M>(&Arguments::of::<M>(interface));
    let [message] = &log.expect_err("it has no such interface")[..] else { panic!("one message expected") };
    message.text.clone()
}

#[test]
fn the_other_interface_type() {
    assert_eq!(refused_interface::<Sum>(ModelExchange), "fmi2Instantiate: this FMU has no Model Exchange");
    assert_eq!(
        refused_interface::<drift::Drift>(CoSimulation),
        "fmi2Instantiate: this FMU has no Co-Simulation"
    );
}

/// Checks that errors of the model reach the importer with their message, and the step can be repeated.
#[test]
fn errors_of_the_model() {
    let fmu = Importer::of::<Sum>(CoSimulation);
    fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, -1.0, 0, 0.0));
    let message = fmu.refused("start time", |fmu| fmu.fmi2EnterInitializationMode());
    assert_eq!(message, "fmi2EnterInitializationMode: this model knows no time before 0");
    fmu.initialize(0.0);
    fmu.set(&[U], &[9.0]);
    fmu.step(0.0, 1.0);
    let message = fmu.refused("sum", |fmu| fmu.try_step(1.0, 1.0));
    assert_eq!(message, "fmi2DoStep: the sum would be more than 10");
    fmu.set(&[U], &[1.0]);
    fmu.step(1.0, 1.0);
    assert_eq!(fmu.get([Y]), [10.0]);
}

/// Checks that the range of a parameter's type is enforced; the range of an input or output is a hint.
#[test]
fn ranges() {
    let fmu = Importer::of::<Sum>(CoSimulation);
    for (value, word) in [(10.5, "above 10"), (-0.5, "below 0")] {
        let message = fmu.refused("gain", |fmu| fmu.try_set(&[GAIN], &[value]));
        assert!(message.contains("gain") && message.contains(word), "{message}");
        fmu.set(&[U, Y], &[value, value]);
    }
    fmu.set(&[GAIN], &[10.0]);
}
