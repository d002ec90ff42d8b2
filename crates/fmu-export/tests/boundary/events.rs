//! Events, steps that end early, and models that end the simulation: sections 3.2.2, 4.2.1 and 4.2.3 of FMI
//! 2.0; 2.3.5 and 4.2.1 of FMI 3.0.

use crate::models::*;
use fmu_export::Interface::*;
use fmu_export::fmi3::{indicator, types::*};
use fmu_export::{Exported, Mode};
use fmu_test_kit::fmi3::Stepped;
use fmu_test_kit::{Arguments, Either, Importer, Updated, fmi3};

const SUM: u32 = counter::Name::sum as u32;
const WEIGHT: u32 = counter::Name::weight as u32;
const LIMIT: u32 = counter::Name::limit as u32;
const TEMPERATURE: u32 = fuse::Name::temperature as u32;

/// Combinations of eventModeUsed and earlyReturnAllowed for which the FMU must handle events within a step, because the
/// importer cannot handle them at their time.
const UNAWARE: [(fmi3Boolean, fmi3Boolean); 3] =
    [(fmi3False, fmi3False), (fmi3False, fmi3True), (fmi3True, fmi3False)];

fn of_fmi3<M: Exported>(
    event_mode_used: fmi3Boolean,
    early_return_allowed: fmi3Boolean,
    prepare: impl FnOnce(&fmi3::Importer),
) -> fmi3::Importer {
    let arguments = Arguments { event_mode_used, early_return_allowed, ..Arguments::new::<M>(CoSimulation) };
    let fmu = fmi3::Importer::make::<M>(&arguments).unwrap();
    prepare(&fmu);
    fmu.initialize(0.0);
    fmu
}

fn of_fmi2<M: Exported>(prepare: impl FnOnce(&Importer)) -> Importer {
    let fmu = Importer::new::<M>(CoSimulation);
    prepare(&fmu);
    fmu.initialize(0.0);
    fmu
}

/// Results of a step that ends immediately; the tests change some fields.
const IMMEDIATE: Stepped = Stepped {
    event_handling_needed: false,
    terminate: false,
    early_return: false,
    last_successful_time: 0.0,
};

/// Checks that a step of FMI 3.0 is rejected with this status and changes nothing. Returns the last message.
#[track_caller]
fn undone(fmu: &fmi3::Importer, expected: Status, point: f64, step_size: f64) -> String {
    let before = fmu.bytes();
    fmu.take_log();
    assert_eq!(fmu.do_step(point, step_size), Err(expected));
    let message = fmu.take_log().pop().unwrap();
    assert_eq!((message.status, fmu.bytes()), (expected, before), "{message:?}");
    message.message
}

/// Returns the time that an instance of FMI 2.0 has reached, and whether the model requests the end of the
/// simulation.
fn progress(fmu: &Importer) -> (f64, bool) {
    const LAST_SUCCESSFUL_TIME: i32 = 2;
    const TERMINATED: i32 = 3;
    let (mut time, mut terminated) = (f64::NAN, -1);
    fmu.ok(fmu.fmi2GetRealStatus(LAST_SUCCESSFUL_TIME, &mut time));
    fmu.ok(fmu.fmi2GetBooleanStatus(TERMINATED, &mut terminated));
    (time, terminated == 1)
}

/// Checks that a step of FMI 2.0 is discarded; returns the messages, joined to one string.
fn discarded(fmu: &Importer, point: f64, step_size: f64) -> String {
    fmu.ok(fmu.set_debug_logging(true, &[c"logStatusDiscard"]));
    assert_eq!(fmu.try_step(point, step_size), Status::Discard);
    let log = fmu.take_log();
    assert_eq!(log.iter().filter(|message| message.category == "logStatusDiscard").count(), 1, "{log:?}");
    log.into_iter().map(|message| message.message).collect::<Vec<_>>().join("; ")
}

/// Checks a state event, its effects, and the results of completed integrator steps.
fn bounces<F: Either>() {
    let fmu: F = F::in_mode::<Ball>(ModelExchange, Mode::Instantiated);
    fmu.set(&[0, 1], &[0.0, -2.0]);
    fmu.initialize(0.0);
    let bounced = Updated { states_changed: true, nominals_changed: true, ..Updated::default() };
    assert_eq!(fmu.update(), bounced);
    assert_eq!(fmu.states::<2>(), [0.0, 1.4]);
    fmu.ok(fmu.enter_continuous_time_mode());
    fmu.ok(fmu.set_time(0.1));
    let (mut z, mut nominals) = (f64::NAN, [f64::NAN; 2]);
    fmu.ok(fmu.set_states([-0.1, -1.0].as_ptr(), 2));
    assert_eq!(fmu.derivatives::<2>(), [-1.0, -9.81]);
    fmu.ok(fmu.get_indicators(&mut z, 1));
    assert_eq!(z, -0.1);
    fmu.ok(fmu.get_nominals(nominals.as_mut_ptr(), 2));
    assert!(
        (nominals[0] - 1.4_f64.powi(2) / (2.0 * 9.81)).abs() < 1e-12 && nominals[1] > 0.0,
        "{nominals:?}"
    );
    // If the ball is below the ground and falls, an event was missed. Far below, the model ends the simulation.
    for (x, expected) in [
        ([1.0, -1.0], [false, false]),
        ([-0.5, -1.0], [true, false]),
        ([-0.5, 1.0], [false, false]),
        ([-200.0, -1.0], [true, true]),
    ] {
        fmu.ok(fmu.set_states(x.as_ptr(), 2));
        assert_eq!(fmu.completed_step(), expected, "{x:?}");
    }
    fmu.ok(fmu.enter_event_mode());
    assert!(fmu.update().states_changed);
    assert_eq!(fmu.integer(ball::Name::bounces as u32), 2);
    fmu.ok(fmu.terminate());
    // An importer may enter Event Mode at any time. The oscillator has no events, so nothing changes.
    let fmu: F = F::in_mode::<Oscillator>(ModelExchange, Mode::ContinuousTime);
    assert_eq!(fmu.completed_step(), [false; 2]);
    for _ in 0..3 {
        fmu.ok(fmu.enter_event_mode());
        fmu.ok(fmu.enter_event_mode());
        assert_eq!([fmu.update(), fmu.enter_continuous_time()], [Updated::default(); 2]);
    }
}

/// Checks time events. An event that causes another one at the same time needs one more iteration, and between the two
/// the count can be read before it is reduced.
fn event_iteration<F: Either>() {
    let fmu: F = F::in_mode::<Counter>(ModelExchange, Mode::Instantiated);
    fmu.ok(fmu.set_integer(counter::Name::increment as u32, 7));
    fmu.initialize(0.0);
    let round = || {
        let Updated { again, next, .. } = fmu.update();
        (again, next.unwrap(), fmu.integer(counter::Name::count as u32))
    };
    assert_eq!(round(), (false, 0.25, 7));
    assert_eq!(round(), (false, 0.25, 7), "one more iteration must change nothing");
    // After two periods, two counts are due. Each makes the count exceed its limit of 10, so that it is reduced.
    fmu.ok(fmu.enter_continuous_time_mode());
    fmu.ok(fmu.set_time(0.5));
    fmu.ok(fmu.enter_event_mode());
    assert_eq!(round(), (true, 0.5, 14));
    assert_eq!(round(), (true, 0.5, 4));
    assert_eq!(round(), (true, 0.75, 11));
    assert_eq!(round(), (false, 0.75, 1));
}

#[test]
fn in_model_exchange() {
    bounces::<Importer>();
    bounces::<fmi3::Importer>();
    event_iteration::<Importer>();
    event_iteration::<fmi3::Importer>();
}

/// Checks that an event indicator is a variable (section 2.4.8 of FMI 3.0), and that states may be set in Event Mode even
/// if the model never changes them at events (section 2.3.5).
#[test]
fn indicators_and_states_of_fmi3() {
    let fmu = fmi3::Importer::in_mode::<Ball>(ModelExchange, Mode::ContinuousTime);
    let index = indicator::<Ball>(0);
    assert_eq!(fmu.get([index]), [1.0]);
    fmu.rejected("a calculated local", |fmu| fmu.try_set(&[index], &[1.0]));
    fmu.rejected("no variable", |fmu| fmu.try_get(&[index + 1], &mut [0.0]));
    let (mut states, mut indicators) = (0, 0);
    let fmu = fmi3::Importer::in_mode::<Ball>(ModelExchange, Mode::Event);
    fmu.ok(fmu.fmi3GetNumberOfContinuousStates(&mut states));
    fmu.ok(fmu.fmi3GetNumberOfEventIndicators(&mut indicators));
    assert_eq!((states, indicators), (2, 1));
    let fmu = fmi3::Importer::in_mode::<Oscillator>(ModelExchange, Mode::Event);
    fmu.set(&[1], &[0.5]);
    assert_eq!(fmu.get([1]), [0.5]);
}

/// Checks an importer that handles events itself, in Event Mode.
#[test]
fn the_importer_handles_events() {
    let fmu = of_fmi3::<Counter>(fmi3True, fmi3True, |_| ());
    fmu.rejected("no step in event mode", |fmu| fmu.try_step(0.0, 1.0));
    assert_eq!(fmu.update(), Updated { next: Some(0.25), ..Updated::default() });
    fmu.ok(fmu.fmi3EnterStepMode());
    let at = |last_successful_time, early_return| {
        Ok(Stepped { event_handling_needed: true, early_return, last_successful_time, ..IMMEDIATE })
    };
    assert_eq!(fmu.do_step(0.0, 1.0), at(0.25, true));
    assert_eq!(fmu.get([SUM]), [1.0], "the event must not be handled yet");
    fmu.ok(fmu.fmi3EnterEventMode());
    fmu.set(&[WEIGHT], &[10.0]);
    assert_eq!(fmu.update().next, Some(0.5));
    assert_eq!(fmu.get([SUM]), [11.0]);
    fmu.ok(fmu.fmi3EnterStepMode());
    // If the event is at the end of the step, the step does not return early.
    assert_eq!(fmu.do_step(0.25, 0.25), at(0.5, false));
    // A model without events has no Event Mode.
    let arguments = Arguments { event_mode_used: fmi3True, ..Arguments::new::<Fuse>(CoSimulation) };
    let log = fmi3::Importer::make::<Fuse>(&arguments).unwrap_err();
    assert!(log[0].message.contains("hasEventMode is false"), "{log:?}");
}

/// Checks that the library handles events within the step if the importer does not handle them.
#[test]
fn the_library_handles_events() {
    fn check(fmu: &impl Either) {
        assert_eq!(fmu.get([SUM]), [1.0], "only the count at the start must be counted");
        fmu.step(0.0, 0.6);
        assert_eq!(fmu.get([SUM]), [3.0]);
    }
    check(&of_fmi2::<Counter>(|_| ()));
    for (event_mode_used, early_return_allowed) in UNAWARE {
        let fmu = of_fmi3::<Counter>(event_mode_used, early_return_allowed, |_| ());
        if event_mode_used == fmi3True {
            fmu.update();
            fmu.ok(fmu.fmi3EnterStepMode());
        }
        check(&fmu);
        if event_mode_used == fmi3False {
            fmu.rejected("no event mode", |fmu| fmu.fmi3EnterEventMode());
        } else {
            assert!(fmu.do_step(0.6, 0.15).unwrap().event_handling_needed);
        }
    }
}

#[test]
fn an_event_ends_the_simulation() {
    let fmu = of_fmi3::<Counter>(fmi3False, fmi3False, |fmu| fmu.set(&[LIMIT], &[3.0]));
    let stepped = fmu.do_step(0.0, 1.0).unwrap();
    assert_eq!((stepped.terminate, stepped.last_successful_time), (true, 0.5));
    // If the importer ignores the request to terminate, the next step returns the same result.
    assert_eq!(fmu.do_step(0.5, 1.0), Ok(stepped));
    fmu.ok(fmu.fmi3Terminate());
}

/// Checks that the first step reports the end of the simulation if an event at the start has requested it (section 4.2.3 of
/// FMI 2.0). In FMI 3.0, this concerns importers that do not use Event Mode, or that ignore the result of
/// fmi3UpdateDiscreteStates, as FMPy does.
#[test]
fn the_initial_event_ends_the_simulation() {
    let fmu = of_fmi2::<Counter>(|fmu| fmu.set(&[LIMIT], &[1.0]));
    assert_eq!(fmu.try_step(0.0, 0.5), Status::Discard);
    assert_eq!(progress(&fmu), (0.0, true));
    fmu.rejected("a step after the end", |fmu| fmu.try_step(0.0, 0.5));
    fmu.ok(fmu.fmi2Terminate());
    for (event_mode_used, early_return) in [(fmi3False, false), (fmi3True, false), (fmi3True, true)] {
        let fmu = of_fmi3::<Counter>(event_mode_used, early_return.into(), |fmu| fmu.set(&[LIMIT], &[1.0]));
        if event_mode_used == fmi3True {
            assert!(fmu.update().terminate);
            fmu.ok(fmu.fmi3EnterStepMode());
        }
        let before = fmu.bytes();
        assert_eq!(fmu.do_step(0.0, 1.0), Ok(Stepped { terminate: true, early_return, ..IMMEDIATE }));
        assert_eq!(fmu.bytes(), before);
        fmu.rejected("a wrong point", |fmu| fmu.try_step(1.0, 1.0));
        fmu.ok(fmu.fmi3Terminate());
    }
}

/// Checks that a step with more than 10,000 events is discarded. In FMI 3.0, it changes nothing and a shorter step then
/// succeeds; in FMI 2.0, it ends early. An event with too many iterations is an error.
#[test]
fn more_events_than_a_step_may_have() {
    const EXPECTED: &str = "it has more than 10000 events; make shorter steps, or give the events hysteresis if the model chatters";
    for (event_mode_used, early_return_allowed) in UNAWARE {
        let fmu = of_fmi3::<Counter>(event_mode_used, early_return_allowed, |_| ());
        if event_mode_used == fmi3True {
            fmu.ok(fmu.fmi3EnterStepMode());
        }
        let text = undone(&fmu, Status::Discard, 0.0, 2501.0);
        assert!(text.ends_with(EXPECTED), "{text}");
        fmu.step(0.0, 2499.1);
    }
    let fmu = of_fmi2::<Counter>(|_| ());
    fmu.step(0.0, 2500.0);
    let text = discarded(&fmu, 2500.0, 2500.25);
    assert!(text.contains("at 5000.25: ") && text.contains(EXPECTED), "{text}");
    assert_eq!(progress(&fmu), (5000.25, false));
    // At this time, the period vanishes when it is added, so the event always requests another iteration.
    let fmu = Importer::new::<Counter>(CoSimulation);
    fmu.enter_initialization(1e20, None);
    assert_eq!(fmu.fmi2ExitInitializationMode(), Status::Error);
    let log = fmu.take_log();
    let words = "does not come to an end in 10000 rounds";
    assert!(log.iter().any(|message| message.message.contains(words)), "{log:?}");
}

/// Checks early returns. The fuse warms up from 20 degrees by 10 degrees per second, so it is hot after 8 s and melts
/// after 18 s.
#[test]
fn early_return() {
    let fmu = of_fmi3::<Fuse>(fmi3False, fmi3True, |_| ());
    let early = Stepped { early_return: true, last_successful_time: 8.0, ..IMMEDIATE };
    assert_eq!(fmu.do_step(0.0, 10.0), Ok(early));
    // The simulation continues from there until the fuse melts.
    let stepped = fmu.do_step(8.0, 20.0).unwrap();
    assert_eq!(stepped, Stepped { terminate: true, last_successful_time: 18.0, ..early });
    assert_eq!(fmu.do_step(18.0, 1.0), Ok(stepped));
    fmu.ok(fmu.fmi3Reset());
    fmu.initialize(0.0);
    fmu.step(0.0, 1.0);
    // If early return is not allowed, the step is discarded and changes nothing, so that a shorter one is possible.
    let fmu = of_fmi3::<Fuse>(fmi3False, fmi3False, |_| ());
    let text = undone(&fmu, Status::Discard, 0.0, 10.0);
    assert!(
        text.contains("ends early, at 8: the model stops there, but earlyReturnAllowed is false"),
        "{text}"
    );
    fmu.step(0.0, 8.0);
    // The end of the simulation is reported without early return.
    let ended = Stepped { terminate: true, last_successful_time: 18.0, ..IMMEDIATE };
    assert_eq!(fmu.do_step(8.0, 20.0), Ok(ended));
}

/// Checks what an importer of FMI 2.0 can do after a step that ended early: read the time that was reached, and restore
/// a state and make a shorter step, or end the simulation there, or reset the instance.
#[test]
fn an_early_end_and_a_shorter_step() {
    let fmu = of_fmi2::<Fuse>(|_| ());
    fmu.step(0.0, 5.0);
    let state = fmu.save();
    let message = discarded(&fmu, 5.0, 5.0);
    assert!(message.contains("10") && message.contains("early, at 8"), "{message}");
    assert_eq!(progress(&fmu), (8.0, false));
    assert_eq!(fmu.get([TEMPERATURE]), [100.0], "the value at the early end must be readable");
    fmu.rejected("a step after it", |fmu| fmu.try_step(8.0, 1.0));
    fmu.rejected("an input after it", |fmu| fmu.try_set(&[fuse::Name::load as u32], &[0.0]));
    fmu.ok(fmu.fmi2Terminate());
    assert_eq!(progress(&fmu), (8.0, false));
    fmu.ok(fmu.fmi2SetFMUstate(state));
    assert_eq!(progress(&fmu), (5.0, false));
    fmu.step(5.0, 3.0);
    fmu.step(8.0, 1.0);
    assert_eq!(fmu.get([TEMPERATURE]), [110.0]);
    let message = discarded(&fmu, 9.0, 20.0);
    assert!(message.contains("ends the simulation at 18"), "{message}");
    assert_eq!(progress(&fmu), (18.0, true));
    let bytes = fmu.bytes();
    fmu.ok(fmu.fmi2Terminate());
    assert_eq!(progress(&fmu), (18.0, true));
    // The state includes the end of the simulation.
    let other = Importer::new::<Fuse>(CoSimulation);
    other.restore(&bytes);
    assert_eq!(progress(&other), (18.0, true));
    fmu.ok(fmu.fmi2SetFMUstate(state));
    discarded(&fmu, 5.0, 5.0);
    fmu.ok(fmu.fmi2Reset());
    fmu.initialize(0.0);
    assert_eq!(fmu.get([TEMPERATURE]), [20.0]);
}

/// A model that ends every step early, or at an event if its input is 1, but declares neither.
mod hasty {
    use fmu_export::*;

    variables! {
        pub struct Hasty;
        /// Input
        u: f64 = input(&NUMBER);
    }

    impl Model for Hasty {
        const INFO: Info = info!("Hasty", "hasty");
    }

    impl CoSimulation for Hasty {
        fn step(&mut self, step: Step) -> Result<Stepped, Error> {
            Ok(if self.u == 1.0 { Stepped::Event(step.time) } else { Stepped::Early(step.time) })
        }
    }

    offer!(Hasty: CoSimulation);
}

/// Checks that a step that ends early is fatal if the model does not declare it, because it contradicts the model description.
#[test]
fn an_early_end_that_the_model_has_not_announced() {
    fn check<F: Either>() {
        let fmu = F::initialized_at::<hasty::Hasty>(0.0);
        assert_eq!(fmu.try_step(0.0, 1.0), Status::Fatal);
        let log = fmu.take_log();
        assert!(log.len() == 1 && log[0].message.contains("const ENDS_EARLY: bool = true"), "{log:?}");
    }
    check::<Importer>();
    check::<fmi3::Importer>();
}

/// Checks that the message names the declaration that events need, which differs from the one for early ends.
#[test]
#[should_panic(expected = "add `const EVENTS: Events = Events::Stop;` to its impl CoSimulation")]
fn an_event_that_the_model_has_not_declared() {
    let _ = fmu_export::Simulation::<hasty::Hasty>::new().unwrap().set("u", 1.0).unwrap().run(1.0);
}
