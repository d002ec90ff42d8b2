//! Tests of `Model::calculate`: after any change, it runs again before a value is read and before an event.

use crate::models::{Lazy, lazy::Name};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::fmi2::types::Status;
use fmu_test_kit::{Either, Importer};

const SUM: u32 = Name::sum as u32;
const REAL: u32 = Name::real as u32;
const BOOLEAN: u32 = Name::boolean as u32;
const STATE: u32 = Name::state as u32;

/// Returns the sum that `calculate` has stored. Asserts that it equals the sum of the current values.
#[track_caller]
fn sum(fmu: &Importer) -> f64 {
    let [sum, summands, time] = fmu.get([SUM, Name::summands as u32, Name::time as u32]);
    assert_eq!(sum, summands + time);
    sum
}

/// Checks that a call changes the sum although it was already calculated before the call.
#[track_caller]
fn changes(fmu: &Importer, call: impl FnOnce(&Importer)) {
    let before = sum(fmu);
    call(fmu);
    assert_ne!(sum(fmu), before);
}

#[test]
fn after_every_change_in_co_simulation() {
    let fmu = Importer::new::<Lazy>(CoSimulation);
    fmu.initialize(0.0);
    changes(&fmu, |fmu| fmu.set(&[REAL], &[7.0]));
    changes(&fmu, |fmu| fmu.ok(fmu.fmi2SetInteger(&(Name::integer as u32), 1, &8)));
    changes(&fmu, |fmu| fmu.ok(fmu.fmi2SetString(&(Name::string as u32), 1, &c"longer".as_ptr())));
    changes(&fmu, |fmu| fmu.set(&[Name::weight as u32], &[9.0]));
    changes(&fmu, |fmu| fmu.set_input_derivatives(&[REAL], &[0.5]));
    changes(&fmu, |fmu| fmu.step(0.0, 1.0));
    changes(&fmu, |fmu| fmu.ok(fmu.fmi2SetBoolean(&BOOLEAN, 1, &1)));
    changes(&fmu, |fmu| assert_eq!(fmu.try_step(1.0, 1.0), Status::Discard));
    fmu.ok(fmu.fmi2Reset());
    fmu.enter_initialization(0.0, None);
    sum(&fmu);
}

#[test]
fn after_every_change_in_model_exchange() {
    let fmu = Importer::new::<Lazy>(ModelExchange);
    let nominal = || {
        let mut nominal = 0.0;
        fmu.ok(fmu.fmi2GetNominalsOfContinuousStates(&mut nominal, 1));
        nominal
    };
    let at_0 = nominal();
    fmu.ok(fmu.fmi2SetupExperiment(0, 0.0, 2.0, 0, 0.0));
    assert_eq!(nominal(), at_0 + 2.0);
    fmu.ok(fmu.fmi2EnterInitializationMode());
    fmu.ok(fmu.fmi2ExitInitializationMode());
    changes(&fmu, |fmu| fmu.ok(fmu.fmi2NewDiscreteStates(&mut Default::default())));
    fmu.ok(fmu.fmi2EnterContinuousTimeMode());
    changes(&fmu, |fmu| fmu.ok(fmu.fmi2SetTime(3.0)));
    changes(&fmu, |fmu| fmu.ok(fmu.fmi2SetContinuousStates(&0.25, 1)));
    changes(&fmu, |fmu| fmu.ok(fmu.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0)));
}

/// Checks that values are calculated again, after a change, by all functions that read them, and before an event and a
/// completed step, which use them.
#[test]
fn before_everything_that_needs_it() {
    let fmu = Importer::new::<Lazy>(ModelExchange);
    fmu.initialize(0.0);
    let mut value = 0.0;
    for (round, call) in (1..).zip([
        (|fmu, value| fmu.fmi2GetEventIndicators(value, 1)) as fn(&Importer, &mut f64) -> Status,
        |fmu, value| fmu.fmi2GetNominalsOfContinuousStates(value, 1),
        |fmu, value| fmu.fmi2GetDerivatives(value, 1),
        |fmu, value| fmu.fmi2GetDirectionalDerivative(&SUM, 1, &REAL, 1, &1.0, value),
        |fmu, value| fmu.fmi2GetReal(&SUM, 1, value),
    ]) {
        sum(&fmu);
        fmu.set(&[REAL], &[10.0 * f64::from(round)]);
        fmu.ok(call(&fmu, &mut value));
        assert_eq!(value, sum(&fmu), "call {round}");
    }
    let completes: [fn(&Importer) -> Status; 2] = [
        |fmu| fmu.fmi2NewDiscreteStates(&mut Default::default()),
        |fmu| {
            fmu.ok(fmu.fmi2EnterContinuousTimeMode());
            fmu.fmi2CompletedIntegratorStep(1, &mut 0, &mut 0)
        },
    ];
    for complete in completes {
        let before = sum(&fmu);
        fmu.set(&[REAL], &[fmu.get([REAL])[0] + 1.0]);
        fmu.ok(complete(&fmu));
        assert_eq!(fmu.get([STATE]), [before + 1.0]);
    }

    let fmu = Importer::new::<Lazy>(CoSimulation);
    fmu.initialize(0.0);
    sum(&fmu);
    fmu.set(&[REAL], &[7.0]);
    assert_eq!(fmu.rates([SUM]), [sum(&fmu)]);
}

/// Checks states that were saved after a change but before the calculation: a new one, one saved over an earlier state,
/// and a serialized one.
#[test]
fn after_a_state_is_restored() {
    let fmu = Importer::new::<Lazy>(CoSimulation);
    fmu.initialize(0.0);
    sum(&fmu);
    let mut used = fmu.save();
    fmu.set(&[REAL], &[2.0]);
    let new = fmu.save();
    fmu.ok(fmu.fmi2GetFMUstate(&mut used));
    let bytes = fmu.bytes();
    for state in [new, used] {
        fmu.set(&[REAL], &[3.0]);
        changes(&fmu, |fmu| fmu.ok(fmu.fmi2SetFMUstate(state)));
        fmu.forget(state);
    }
    fmu.set(&[REAL], &[3.0]);
    changes(&fmu, |fmu| fmu.restore(&bytes));
}
