//! Start values: rejected ones, and start values of states that the model calculates. An instance records rejected start
//! values, because some importers (fmi-sim, OMSimulator) ignore the error and would simulate with other values.

use crate::INTERFACES;
use crate::models::{Meter, Oscillator, Talker, meter, oscillator::Name, talker};
use fmu_export::Interface::{CoSimulation, ModelExchange};
use fmu_export::Mode::{self, *};
use fmu_export::fmi2::types::Status;
use fmu_test_kit::{Either, Importer, fmi3};
use std::ptr::null;

const MASS: u32 = Name::mass as u32;
const STIFFNESS: u32 = Name::stiffness as u32;

/// Leaves this mode for the next one.
fn leave_mode<F: Either>(fmu: &F, mode: Mode) -> Status {
    if mode == Instantiated {
        fmu.enter_initialization_mode(0.0, None)
    } else {
        fmu.exit_initialization_mode()
    }
}

/// Sets an invalid start value with `wrong` in each mode that accepts start values. Checks that the mode cannot be left,
/// with the same message as before, until `right` has set a valid value.
#[track_caller]
fn is_remembered<F: Either>(wrong: impl Fn(&F) -> Status, right: impl Fn(&F) -> Status) {
    for (interface, mode) in INTERFACES.into_iter().flat_map(|i| [(i, Instantiated), (i, Initialization)]) {
        let fmu = F::in_mode::<Oscillator>(interface, mode);
        let first = fmu.rejected("a start value", &wrong);
        for _ in 0..2 {
            let again = fmu.rejected("the end of the mode", |fmu| leave_mode(fmu, mode));
            assert_eq!(again.split_once(": ").unwrap().1, first.split_once(": ").unwrap().1);
        }
        fmu.ok(right(&fmu));
        fmu.ok(leave_mode(&fmu, mode));
    }
}

#[test]
fn a_rejected_start_value_is_remembered() {
    fn check<F: Either>() {
        let [force, springs, damped, damping] =
            [Name::force, Name::springs, Name::damped, Name::damping].map(|name| name as u32);
        is_remembered::<F>(|fmu| fmu.try_set(&[MASS], &[-1.0]), |fmu| fmu.try_set(&[MASS], &[3.0]));
        is_remembered::<F>(|fmu| fmu.try_set(&[force], &[f64::NAN]), |fmu| fmu.try_set(&[force], &[0.0]));
        is_remembered::<F>(|fmu| fmu.set_integer(springs, 10), |fmu| fmu.set_integer(springs, 9));
        is_remembered::<F>(|fmu| fmu.set_boolean(damped, 2), |fmu| fmu.set_boolean(damped, 1));
        // This value is in its range, but the model rejects it in `update`.
        is_remembered::<F>(|fmu| fmu.try_set(&[damping], &[1e6]), |fmu| fmu.try_set(&[damping], &[0.0]));
        for mode in [Instantiated, Initialization] {
            let fmu = F::in_mode::<Talker>(CoSimulation, mode);
            let greet = |text| fmu.set_string(talker::Name::greeting as u32, text);
            for text in [null(), c"\xff".as_ptr()] {
                assert_eq!(greet(text), Status::Error);
            }
            fmu.take_log();
            fmu.rejected_with(&["the string for greeting"], |fmu| leave_mode(fmu, mode));
            fmu.ok(greet(c"Good morning".as_ptr()));
            fmu.ok(leave_mode(&fmu, mode));
        }
    }
    check::<Importer>();
    check::<fmi3::Importer>();
}

/// Checks that all variables of a rejected call must be set again, because the call sets none of them.
#[test]
fn every_variable_of_a_rejected_call() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, Instantiated);
    let enter = |fmu: &Importer| fmu.rejected("the start", |fmu| fmu.fmi2EnterInitializationMode());
    let of_mass = "mass must not be below 0.001, it is -1";
    let of_stiffness = "stiffness was not set, because mass in the same call was rejected: set it again";
    assert_eq!(fmu.try_set(&[STIFFNESS, MASS], &[60.0, -1.0]), Status::Error);
    assert_eq!(enter(&fmu), format!("fmi2EnterInitializationMode: {of_mass}; {of_stiffness}"));
    fmu.set(&[MASS], &[1.0]);
    assert_eq!(enter(&fmu), format!("fmi2EnterInitializationMode: {of_stiffness}"));
    fmu.set(&[STIFFNESS], &[60.0]);
    fmu.initialize(0.0);
}

/// Checks that the model's error about a combination of values is reported only once.
#[test]
fn values_that_do_not_fit_together() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, Instantiated);
    assert_eq!(fmu.try_set(&[MASS, Name::damping as u32], &[1.0, 1e6]), Status::Error);
    let message = fmu.rejected("the start", |fmu| fmu.fmi2EnterInitializationMode());
    assert_eq!(message.matches("nothing oscillates").count(), 1, "{message}");
}

#[test]
fn reset_and_restored_states_start_again() {
    let fmu = Importer::in_mode::<Oscillator>(CoSimulation, Initialization);
    let (state, bytes) = (fmu.save(), fmu.bytes());
    let ways: [&dyn Fn(); 3] = [&|| fmu.ok(fmu.fmi2SetFMUstate(state)), &|| fmu.restore(&bytes), &|| {
        fmu.ok(fmu.fmi2Reset());
        fmu.enter_initialization(0.0, None);
    }];
    for way in ways {
        assert_eq!(fmu.try_set(&[MASS], &[-1.0]), Status::Error);
        fmu.take_log();
        way();
        fmu.ok(fmu.fmi2ExitInitializationMode());
        fmu.restore(&bytes);
    }
    fmu.forget(state);
}

/// Checks that only rejected start values are recorded. Other rejected calls have no consequences, because importers
/// probe what an FMU accepts. A value that is rejected during the simulation has none either.
#[test]
fn probing_has_no_consequences() {
    for interface in INTERFACES {
        let fmu = Importer::in_mode::<Oscillator>(interface, Instantiated);
        for status in [
            fmu.fmi2GetReal(&MASS, 1, &mut 0.0),
            fmu.try_set(&[Name::energy as u32], &[1.0]),
            fmu.try_set(&[999], &[1.0]),
            fmu.try_set(&[Name::springs as u32], &[1.0]),
            fmu.fmi2SetReal(&MASS, 1, null()),
            fmu.fmi2ExitInitializationMode(),
            fmu.try_step(0.0, 0.1),
        ] {
            assert_eq!(status, Status::Error);
        }
        fmu.take_log();
        fmu.initialize(0.0);
        assert_eq!(fmu.try_set(&[MASS], &[-1.0]), Status::Error);
        fmu.take_log();
        fmu.ok(fmu.fmi2Terminate());
    }
}

/// Checks that a calculated start value follows the values on which it depends until the first step or Continuous-Time
/// Mode, or until the importer sets the state. It does so even in a restored state.
fn calculated_start<F: Either>() {
    let [plain, stiffness, level] =
        [meter::Name::plain, meter::Name::stiffness, meter::Name::level].map(|name| name as u32);
    for interface in INTERFACES {
        let fmu = F::new::<Meter>(interface);
        fmu.set(&[plain, stiffness], &[6.0, 2.0]);
        let words = ["its start follows from plain, stiffness: set these"];
        fmu.rejected_with(&words, |fmu| fmu.try_set(&[level], &[1.0]));
        fmu.enter_initialization(0.0, None);
        assert_eq!(fmu.get([level]), [3.0]);
        fmu.rejected_with(&words, |fmu| fmu.try_set(&[level], &[1.0]));
        fmu.ok(fmu.exit_initialization_mode());
        fmu.set(&[plain], &[8.0]);
        assert_eq!(fmu.get([level]), [4.0]);
        let restored = fmu.bytes();
        match interface {
            CoSimulation => fmu.step(0.0, 0.5),
            ModelExchange => _ = fmu.enter_continuous_time(),
        }
        let started = fmu.get([level]);
        fmu.set(&[plain], &[0.0]);
        assert_eq!(fmu.get([level]), started, "{interface}");
        fmu.restore(&restored);
        fmu.set(&[plain], &[10.0]);
        assert_eq!(fmu.get([level]), [5.0]);
    }
    // OpenModelica sets states while still in Event Mode.
    let fmu = F::in_mode::<Meter>(ModelExchange, Event);
    fmu.ok(fmu.set_states(&7.0, 1));
    fmu.set(&[plain], &[8.0]);
    assert_eq!(fmu.get([level]), [7.0]);
}

#[test]
fn calculated_starts() {
    calculated_start::<Importer>();
    calculated_start::<fmi3::Importer>();
}
