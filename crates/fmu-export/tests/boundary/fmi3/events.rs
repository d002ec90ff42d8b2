//! Events in Model Exchange and in Co-Simulation with and without Event Mode, and steps that end early.

use crate::models::grumbler::{self, Trouble};
use crate::models::ticker::Name;
use crate::models::*;
use fmu_export::Interface::*;
use fmu_export::fmi3::{indicator, reference, types::*};
use fmu_test_kit::fmi3::{Importer, Stepped};
use fmu_test_kit::{Arguments, Either, Updated};

const SUM: u32 = Name::sum as u32;
const AMOUNT: u32 = Name::amount as u32;

fn ticker(event_mode_used: fmi3Boolean, early_return_allowed: fmi3Boolean) -> Importer {
    let arguments =
        Arguments { event_mode_used, early_return_allowed, ..Arguments::of::<Ticker>(CoSimulation) };
    let fmu = Importer::with::<Ticker>(&arguments);
    fmu.initialize(0.0);
    fmu
}

#[test]
fn in_model_exchange() {
    let fmu = Importer::of::<Ball>(ModelExchange);
    fmu.set(&[0, 1], &[0.0, -2.0]);
    fmu.initialize(0.0);
    let (mut states, mut indicators) = (0, 0);
    fmu.ok(fmu.fmi3GetNumberOfContinuousStates(&mut states));
    fmu.ok(fmu.fmi3GetNumberOfEventIndicators(&mut indicators));
    assert_eq!((states, indicators), (2, 1));
    let bounced = fmu.update();
    assert_eq!(bounced, Updated { states_changed: true, nominals_changed: true, ..Updated::default() });
    let (mut x, mut rates, mut nominals, mut z) = ([f64::NAN; 2], [f64::NAN; 2], [f64::NAN; 2], f64::NAN);
    fmu.ok(fmu.fmi3GetContinuousStates(x.as_mut_ptr(), 2));
    assert_eq!(x, [0.0, 1.4]);
    fmu.ok(fmu.fmi3EnterContinuousTimeMode());
    fmu.ok(fmu.fmi3SetTime(0.1));
    fmu.ok(fmu.fmi3SetContinuousStates([-0.1, -1.0].as_ptr(), 2));
    fmu.ok(fmu.fmi3GetContinuousStateDerivatives(rates.as_mut_ptr(), 2));
    assert_eq!(rates, [-1.0, -9.81]);
    fmu.ok(fmu.fmi3GetEventIndicators(&mut z, 1));
    assert_eq!(z, -0.1);
    // Section 2.4.8: a variable represents the event indicator.
    let vr = reference(indicator::<Ball>(0));
    assert_eq!(fmu.get([indicator::<Ball>(0)]), [-0.1]);
    fmu.refused("a calculated local", |fmu| fmu.fmi3SetFloat64(&vr, 1, &1.0, 1));
    fmu.refused("no variable", |fmu| fmu.fmi3GetFloat64(&(vr + 1), 1, &mut 0.0, 1));
    fmu.ok(fmu.fmi3GetNominalsOfContinuousStates(nominals.as_mut_ptr(), 2));
    assert!(nominals.iter().all(|nominal| *nominal > 0.0));
    let (mut event, mut terminate) = (9, 9);
    fmu.ok(fmu.fmi3CompletedIntegratorStep(fmi3True, &mut event, &mut terminate));
    assert_eq!((event, terminate), (fmi3True, fmi3False));
    fmu.ok(fmu.fmi3EnterEventMode());
    assert!(fmu.update().states_changed);
    fmu.ok(fmu.fmi3Terminate());
}

/// Section 2.3.5: states without reinit may be set in Event Mode.
#[test]
fn states_in_event_mode() {
    let fmu = Importer::of::<Oscillator>(ModelExchange);
    fmu.initialize(0.0);
    fmu.set(&[1], &[0.5]);
    assert_eq!(fmu.get([1]), [0.5]);
}

#[test]
fn the_importer_handles_them() {
    let fmu = ticker(fmi3True, fmi3True);
    fmu.refused("no step in event mode", |fmu| fmu.do_step(0.0, 1.0).unwrap_err());
    assert_eq!(fmu.update(), Updated { next: Some(0.25), ..Updated::default() });
    fmu.ok(fmu.fmi3EnterStepMode());
    let at = |time: f64, early_return: bool| {
        Ok(Stepped {
            event_handling_needed: true,
            terminate: false,
            early_return,
            last_successful_time: time,
        })
    };
    assert_eq!(fmu.do_step(0.0, 1.0), at(0.25, true));
    assert_eq!(fmu.get([SUM]), [1.0], "nothing has happened yet");
    fmu.ok(fmu.fmi3EnterEventMode());
    fmu.set(&[AMOUNT], &[10.0]);
    assert_eq!(fmu.update().next, Some(0.5));
    assert_eq!(fmu.get([SUM]), [11.0]);
    fmu.ok(fmu.fmi3EnterStepMode());
    // An event at the end of a step is not early.
    assert_eq!(fmu.do_step(0.25, 0.25), at(0.5, false));
}

/// If the importer does not handle events, the library handles them within the step. FMI 2.0 returns the same values.
#[test]
fn the_library_handles_them() {
    for (event_mode, early) in [(fmi3False, fmi3False), (fmi3False, fmi3True)] {
        let fmu = ticker(event_mode, early);
        assert_eq!(fmu.get([SUM]), [1.0], "the tick at the begin");
        fmu.step(0.0, 0.6);
        assert_eq!(fmu.get([SUM]), [3.0]);
        fmu.refused("no event mode", |fmu| fmu.fmi3EnterEventMode());
    }
    let fmu = fmu_test_kit::Importer::of::<Ticker>(CoSimulation);
    fmu.initialize(0.0);
    fmu.step(0.0, 0.6);
    assert_eq!(fmu.get([SUM]), [3.0]);
    // With Event Mode but without early return, the library handles events within the step.
    let fmu = ticker(fmi3True, fmi3False);
    fmu.update();
    fmu.ok(fmu.fmi3EnterStepMode());
    fmu.step(0.0, 0.6);
    assert_eq!(fmu.get([SUM]), [3.0]);
    assert!(fmu.do_step(0.6, 0.15).unwrap().event_handling_needed);
}

#[test]
fn an_event_ends_the_simulation() {
    let fmu = Importer::of::<Ticker>(CoSimulation);
    fmu.ok(fmu.fmi3SetInt32(&reference(Name::last as u32), 1, &3, 1));
    fmu.initialize(0.0);
    let stepped = fmu.do_step(0.0, 1.0).unwrap();
    assert_eq!((stepped.terminate, stepped.last_successful_time), (true, 0.5));
    // A repeated step gives the same result if the importer ignored it.
    assert_eq!(fmu.do_step(0.5, 1.0), Ok(stepped));
    fmu.ok(fmu.fmi3Terminate());
}

/// With Event Mode, an importer that ignores the result of fmi3UpdateDiscreteStates (FMPy) is informed by the
/// step. Without Event Mode, every importer is.
#[test]
fn the_initial_event_ends_the_simulation() {
    for (event_mode_used, early_return) in [(fmi3False, false), (fmi3True, false), (fmi3True, true)] {
        let fmu = grumbler(Trouble::End, event_mode_used, early_return.into());
        if event_mode_used == fmi3True {
            assert!(fmu.update().terminate);
            fmu.ok(fmu.fmi3EnterStepMode());
        }
        let before = fmu.bytes();
        let ended = Stepped {
            event_handling_needed: false,
            terminate: true,
            early_return,
            last_successful_time: 0.0,
        };
        assert_eq!(fmu.do_step(0.0, 1.0), Ok(ended));
        assert_eq!(fmu.bytes(), before);
        fmu.refused("a wrong point", |fmu| fmu.do_step(1.0, 1.0).unwrap_err());
        fmu.ok(fmu.fmi3Terminate());
    }
}

fn grumbler(trouble: Trouble, event_mode_used: fmi3Boolean, early_return_allowed: fmi3Boolean) -> Importer {
    let arguments =
        Arguments { event_mode_used, early_return_allowed, ..Arguments::of::<Grumbler>(CoSimulation) };
    let fmu = Importer::with::<Grumbler>(&arguments);
    fmu.ok(fmu.fmi3SetInt64(&reference(grumbler::Name::trouble as u32), 1, &(trouble as i64), 1));
    fmu.initialize(0.0);
    fmu
}

/// Checks that a step is rejected with this status and changes nothing. Returns the last message.
#[track_caller]
fn undone(fmu: &Importer, expected: Status, point: f64, step_size: f64) -> String {
    let before = fmu.bytes();
    fmu.take_log();
    assert_eq!(fmu.do_step(point, step_size), Err(expected));
    let said = fmu.take_log().pop().unwrap();
    assert_eq!((said.status, fmu.bytes()), (expected, before), "{said:?}");
    said.text
}

/// Section 4.2.1: no earlyReturn for errors, and a discarded step changes nothing.
#[test]
fn a_step_that_fails_half_way() {
    for (event_mode_used, early_return_allowed) in
        [(fmi3False, fmi3False), (fmi3False, fmi3True), (fmi3True, fmi3False)]
    {
        let fmu = grumbler(Trouble::Nowhere, event_mode_used, early_return_allowed);
        if event_mode_used == fmi3True {
            while fmu.update().again {}
            fmu.ok(fmu.fmi3EnterStepMode());
        }
        for (trouble, failed) in [(Trouble::SecondRound, "SecondRound"), (Trouble::Step, "Step")] {
            fmu.ok(fmu.fmi3SetInt64(&reference(grumbler::Name::trouble as u32), 1, &(trouble as i64), 1));
            let text = undone(&fmu, Status::Error, 0.0, 1.5);
            assert_eq!(text, format!("fmi3DoStep: the step cannot go on at 1: {failed} has failed"));
        }
        fmu.ok(fmu.fmi3SetInt64(&reference(grumbler::Name::trouble as u32), 1, &0, 1));
        fmu.step(0.0, 1.5);
    }
}

/// Checks that a shorter step succeeds.
#[test]
fn more_events_than_a_step_may_have() {
    for (event_mode_used, early_return_allowed) in
        [(fmi3False, fmi3False), (fmi3False, fmi3True), (fmi3True, fmi3False)]
    {
        let fmu = ticker(event_mode_used, early_return_allowed);
        fmu.ok(fmu.fmi3SetInt32(&reference(Name::last as u32), 1, &i32::MAX, 1));
        if event_mode_used == fmi3True {
            fmu.ok(fmu.fmi3EnterStepMode());
        }
        let text = undone(&fmu, Status::Discard, 0.0, 2501.0);
        assert!(text.ends_with("it has more than 10000 events; make shorter steps"), "{text}");
        fmu.step(0.0, 2499.1);
    }
}

fn fuse(early_return_allowed: fmi3Boolean) -> Importer {
    let arguments = Arguments { early_return_allowed, ..Arguments::of::<Fuse>(CoSimulation) };
    let fmu = Importer::with::<Fuse>(&arguments);
    fmu.initialize(0.0);
    fmu
}

#[test]
fn early_return() {
    let fmu = fuse(fmi3True);
    let stepped = fmu.do_step(0.0, 10.0).unwrap();
    let early = Stepped {
        event_handling_needed: false,
        terminate: false,
        early_return: true,
        last_successful_time: 8.0,
    };
    assert_eq!(stepped, early);
    // The simulation continues from there until the fuse melts.
    let stepped = fmu.do_step(8.0, 20.0).unwrap();
    assert_eq!(stepped, Stepped { terminate: true, last_successful_time: 18.0, ..early });
    assert_eq!(fmu.do_step(18.0, 1.0), Ok(stepped));
    fmu.ok(fmu.fmi3Reset());
    fmu.initialize(0.0);
    fmu.step(0.0, 1.0);
}

/// Section 4.2.1: the step changes nothing, so that a shorter one is possible.
#[test]
fn early_return_that_is_not_allowed() {
    let fmu = fuse(fmi3False);
    let text = undone(&fmu, Status::Discard, 0.0, 10.0);
    assert!(text.contains("ends early, at 8: the model stops there, and earlyReturnAllowed has"), "{text}");
    fmu.step(0.0, 8.0);
    // The end of the simulation is reported without early return.
    let stepped = fmu.do_step(8.0, 20.0).unwrap();
    assert_eq!((stepped.terminate, stepped.early_return), (true, false));
    assert_eq!(stepped.last_successful_time, 18.0);
}

#[test]
fn event_mode_must_be_offered() {
    let arguments = Arguments { event_mode_used: fmi3True, ..Arguments::of::<Fuse>(CoSimulation) };
    let log = Importer::try_with::<Fuse>(&arguments).unwrap_err();
    assert!(log[0].text.contains("hasEventMode is false"), "{log:?}");
}
