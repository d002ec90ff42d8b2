//! An error leaves the instance as it was, even if the model has changed everything before it failed.

use crate::models::clumsy::{ClumsyName, Failure};
use crate::models::*;
use fmu_export::Interface::*;
use fmu_export::{Exported, Status};
use fmu_test_kit::{Arguments, Either, Importer, fmi3};

const U: u32 = ClumsyName::u as u32;
const GAIN: u32 = ClumsyName::gain as u32;
const FAILS: u32 = ClumsyName::fails as u32;
const REALS: [u32; 7] = [
    U,
    ClumsyName::x as u32,
    ClumsyName::der_x as u32,
    ClumsyName::sum as u32,
    ClumsyName::level as u32,
    ClumsyName::shown as u32,
    GAIN,
];

fn fails(fmu: &impl Either, failure: Failure) {
    fmu.ok(fmu.set_item(FAILS, failure as i32));
}

/// Everything that an importer can read: the bits of the Reals, the number of iterations of events, and the serialized state.
type Readings = (Vec<u64>, i32, Vec<u8>);

fn readings(fmu: &impl Either) -> Readings {
    let reals = fmu.read(&REALS).into_iter().map(f64::to_bits).collect();
    (reals, fmu.integer(ClumsyName::rounds as u32), fmu.bytes())
}

/// Lets the model fail with `cause`, checks that the call then fails and changes nothing, and removes the cause. Returns
/// the message.
#[track_caller]
fn undone<F: Either>(fmu: &F, cause: Failure, call: impl FnOnce(&F) -> Status) -> String {
    fails(fmu, cause);
    let before = readings(fmu);
    let message = fmu.rejected(&format!("{cause:?}"), call);
    assert!(message.ends_with(&format!("{cause:?} has failed half-way")), "{message}");
    assert_eq!(readings(fmu), before, "{cause:?}");
    fails(fmu, Failure::Nothing);
    message
}

/// Initializes the instance, after failed attempts if `with_failures`.
fn begin<F: Either>(fmu: &F, with_failures: bool) {
    fmu.set(&[U], &[0.5]);
    if with_failures {
        fails(fmu, Failure::Initialize);
        fmu.rejected_with(&["has failed half-way"], |fmu| fmu.enter_initialization_mode(0.0, None));
        fmu.rejected_with(&["has failed half-way"], |fmu| fmu.set_item(FAILS, Failure::Update as i32));
        fails(fmu, Failure::Nothing);
    }
    fmu.initialize(0.0);
}

/// Simulates in Co-Simulation, with events in some steps. Returns the readings before and after each step.
fn simulate<F: Either, M: Exported>(with_failures: bool) -> Vec<(Readings, Readings)> {
    let fmu = F::new::<M>(CoSimulation);
    begin(&fmu, with_failures);
    let step = |step: u32| {
        let time = 0.35 * f64::from(step);
        if with_failures {
            fmu.set(&[U], &[0.7]);
            undone(&fmu, Failure::Step, |fmu| fmu.try_step(time, 0.35));
            undone(&fmu, Failure::Step, |fmu| fmu.try_step(time, 1e-3));
            if (time + 0.35).floor() > time.floor() {
                for failure in [Failure::Event, Failure::StepAfterEvent] {
                    let message = undone(&fmu, failure, |fmu| fmu.try_step(time, 0.35));
                    let at = format!("DoStep: the step cannot go on at {}: ", time.ceil());
                    assert!(message.contains(&at), "{message}");
                }
            }
        }
        fmu.set(&[U], &[0.1 + time]);
        let before = readings(&fmu);
        fmu.step(time, 0.35);
        (before, readings(&fmu))
    };
    (0..8).map(step).collect()
}

#[test]
fn a_simulation_with_failures_is_the_same_as_without() {
    fn check<F: Either, M: Exported>() {
        assert_eq!(simulate::<F, M>(true), simulate::<F, M>(false), "{}", M::INFO.name);
    }
    check::<Importer, Clumsy>();
    check::<Importer, ClumsyOnHeap>();
    check::<fmi3::Importer, Clumsy>();
    check::<fmi3::Importer, ClumsyOnHeap>();
}

/// Checks an importer that handles events and accepts early returns.
#[test]
fn steps_of_an_importer_that_handles_events() {
    fn check<M: Exported>() {
        let fmu = fmi3::Importer::make::<M>(&Arguments::with_events::<M>(CoSimulation)).unwrap();
        fmu.initialize(0.0);
        while fmu.update().again {}
        fmu.leave_event_mode();
        undone(&fmu, Failure::Step, |fmu| fmu.try_step(0.0, 0.5));
        let stepped = fmu.do_step(0.0, 1.5).unwrap();
        assert_eq!((stepped.event_handling_needed, stepped.last_successful_time), (true, 1.0));
        fmu.ok(fmu.fmi3EnterEventMode());
        assert!(fmu.update().again);
        undone(&fmu, Failure::Event, |fmu| fmu.try_update().unwrap_err());
        fmu.update();
        fmu.ok(fmu.fmi3EnterStepMode());
        undone(&fmu, Failure::StepAfterEvent, |fmu| fmu.try_step(1.0, 0.5));
        fmu.step(1.0, 0.5);
    }
    check::<Clumsy>();
    check::<ClumsyOnHeap>();
}

/// Checks that an event at the start that fails in its second iteration undoes the first one.
#[test]
fn an_event_at_the_start_that_fails() {
    fn check<F: Either, M: Exported>() {
        let fmu = F::new::<M>(CoSimulation);
        fmu.enter_initialization(0.0, None);
        undone(&fmu, Failure::Event, F::exit_initialization_mode);
        fmu.ok(fmu.exit_initialization_mode());
        assert_eq!(fmu.integer(ClumsyName::rounds as u32), 2);
    }
    check::<Importer, Clumsy>();
    check::<Importer, ClumsyOnHeap>();
    check::<fmi3::Importer, Clumsy>();
    check::<fmi3::Importer, ClumsyOnHeap>();
}

#[test]
fn in_model_exchange() {
    fn check<F: Either, M: Exported>() {
        let fmu = F::new::<M>(ModelExchange);
        begin(&fmu, true);
        fmu.enter_continuous_time();
        fmu.ok(fmu.set_time(1.0));
        fmu.ok(fmu.enter_event_mode());
        assert!(fmu.update().again);
        undone(&fmu, Failure::Event, |fmu| fmu.try_update().unwrap_err());
        assert_eq!(fmu.update().next, Some(2.0));
    }
    check::<Importer, Clumsy>();
    check::<Importer, ClumsyOnHeap>();
    check::<fmi3::Importer, Clumsy>();
    check::<fmi3::Importer, ClumsyOnHeap>();
}

#[test]
fn a_failed_step_may_be_tried_again_after_a_reset() {
    fn check<F: Either>() {
        let fmu = F::new::<ClumsyOnHeap>(CoSimulation);
        for _ in 0..2 {
            begin(&fmu, true);
            // Until the first step, the level follows the input.
            undone(&fmu, Failure::StepAfterEvent, |fmu| fmu.try_step(0.0, 1.5));
            fmu.set(&[U], &[0.9]);
            assert_eq!(fmu.get([ClumsyName::level as u32]), [0.9]);
            fmu.step(0.0, 0.5);
            undone(&fmu, Failure::Step, |fmu| fmu.try_step(0.5, 0.25));
            fmu.ok(fmu.reset());
        }
    }
    check::<Importer>();
    check::<fmi3::Importer>();
}
