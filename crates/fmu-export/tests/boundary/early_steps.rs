//! Steps that end early, and models that end the simulation (sections 4.2.1 and 4.2.3).

use crate::models::grumbler::{self, Trouble};
use crate::models::{Fuse, Grumbler, Ticker, fuse::Name, ticker};
use fmu_export::Interface::CoSimulation;
use fmu_export::fmi2::types::*;
use fmu_test_kit::{Either, Importer, fmi3};

const TEMPERATURE: u32 = Name::temperature as u32;
/// Numbers of `fmi2LastSuccessfulTime` and `fmi2Terminated`.
const TIME: i32 = 2;
const TERMINATED: i32 = 3;

/// Returns the time reached, and whether the model requests the end of the simulation.
fn progress(fmu: &Importer) -> (f64, bool) {
    let (mut time, mut terminated) = (f64::NAN, -1);
    fmu.ok(fmu.fmi2GetRealStatus(TIME, &mut time));
    fmu.ok(fmu.fmi2GetBooleanStatus(TERMINATED, &mut terminated));
    (time, terminated == fmi2True)
}

fn discarded(fmu: &Importer, point: f64, step_size: f64) -> String {
    assert_eq!(fmu.try_step(point, step_size), Status::Discard);
    let log = fmu.take_log();
    assert_eq!((log.len(), log[0].category.as_str()), (1, "logStatusDiscard"));
    log[0].text.clone()
}

/// Returns a fuse that warms by 10 degrees per second from 20: hot after 8 s, melted after 18 s.
fn running() -> Importer {
    let fmu = Importer::of::<Fuse>(CoSimulation);
    fmu.ok(fmu.set_debug_logging(true, &[c"logStatusDiscard"]));
    fmu.initialize(0.0);
    fmu.step(0.0, 5.0);
    fmu
}

/// An importer reads the time reached, restores the state, and performs a shorter step to this time.
#[test]
fn an_early_end_and_a_shorter_step() {
    let fmu = running();
    let state = fmu.save();
    let message = discarded(&fmu, 5.0, 5.0);
    assert!(message.contains("10") && message.contains("early, at 8"), "{message}");
    assert_eq!(progress(&fmu), (8.0, false));
    assert_eq!(fmu.get([TEMPERATURE]), [100.0], "readable where it ended");
    fmu.refused("a step after it", |fmu| fmu.try_step(8.0, 1.0));
    fmu.refused("an input after it", |fmu| fmu.try_set(&[Name::load as u32], &[0.0]));
    fmu.ok(fmu.fmi2SetFMUstate(state));
    fmu.forget(state);
    assert_eq!(progress(&fmu), (5.0, false));
    fmu.step(5.0, 3.0);
    fmu.step(8.0, 1.0);
    assert_eq!(fmu.get([TEMPERATURE]), [110.0]);
}

/// The importer ends the simulation there, or resets the instance.
#[test]
fn what_else_a_master_can_do() {
    let fmu = running();
    discarded(&fmu, 5.0, 5.0);
    fmu.ok(fmu.fmi2Terminate());
    assert_eq!(progress(&fmu), (8.0, false));
    let fmu = running();
    discarded(&fmu, 5.0, 5.0);
    fmu.ok(fmu.fmi2Reset());
    fmu.initialize(0.0);
    assert_eq!(fmu.get([TEMPERATURE]), [20.0]);
}

#[test]
fn the_model_ends_the_simulation() {
    let fmu = running();
    fmu.step(5.0, 3.0);
    let message = discarded(&fmu, 8.0, 20.0);
    assert!(message.contains("ends the simulation at 18"), "{message}");
    assert_eq!(progress(&fmu), (18.0, true));
    let bytes = fmu.bytes();
    fmu.ok(fmu.fmi2Terminate());
    assert_eq!(progress(&fmu), (18.0, true));
    // The state includes the end of the simulation.
    let other = Importer::of::<Fuse>(CoSimulation);
    other.restore(&bytes);
    assert_eq!(progress(&other), (18.0, true));
}

/// Checks that nothing is logged without debug logging: in section 2.1.3, fmi2Discard is logged on demand.
#[test]
fn silence() {
    let fmu = Importer::of::<Fuse>(CoSimulation);
    fmu.initialize(0.0);
    assert_eq!(fmu.try_step(0.0, 10.0), Status::Discard);
    assert_eq!(fmu.take_log(), []);
}

fn grumbler(trouble: Trouble) -> Importer {
    let fmu = Importer::of::<Grumbler>(CoSimulation);
    fmu.ok(fmu.fmi2SetInteger(&(grumbler::Name::trouble as u32), 1, &(trouble as i32)));
    fmu
}

fn rounds(fmu: &Importer) -> i32 {
    let mut rounds = -1;
    fmu.ok(fmu.fmi2GetInteger(&(grumbler::Name::rounds as u32), 1, &mut rounds));
    rounds
}

/// Checks that the first iteration is undone and the step ends at the event.
#[test]
fn an_event_that_fails_in_its_second_round() {
    let fmu = grumbler(Trouble::SecondRound);
    fmu.enter_initialization(0.0, None);
    let before = fmu.bytes();
    assert_eq!(fmu.fmi2ExitInitializationMode(), Status::Error);
    assert_eq!(fmu.bytes(), before);
    let fmu = grumbler(Trouble::Nowhere);
    fmu.initialize(0.0);
    assert_eq!(rounds(&fmu), 2);
    fmu.ok(fmu.fmi2SetInteger(&(grumbler::Name::trouble as u32), 1, &(Trouble::SecondRound as i32)));
    assert_eq!(fmu.try_step(0.0, 1.5), Status::Discard);
    assert_eq!((progress(&fmu), rounds(&fmu)), ((1.0, false), 2));
}

/// Section 4.2.3: an importer of FMI 2.0 is informed by the first step.
#[test]
fn the_initial_event_ends_the_simulation() {
    let fmu = grumbler(Trouble::End);
    fmu.initialize(3.0);
    assert_eq!(fmu.try_step(3.0, 0.5), Status::Discard);
    assert_eq!(progress(&fmu), (3.0, true));
    fmu.refused("a step after the end", |fmu| fmu.try_step(3.0, 0.5));
    fmu.ok(fmu.fmi2Terminate());
}

/// Checks more events than a step may have, and an endless event.
#[test]
fn endless_events() {
    let fmu = Importer::of::<Ticker>(CoSimulation);
    fmu.initialize(0.0);
    fmu.ok(fmu.fmi2SetInteger(&(ticker::Name::last as u32), 1, &i32::MAX));
    fmu.step(0.0, 2500.0);
    assert_eq!(fmu.try_step(2500.0, 2500.25), Status::Discard);
    assert_eq!(progress(&fmu), (5000.25, false));
    let log = fmu.take_log();
    assert!(log[0].text.contains("at 5000.25: it has more than 10000 events; make shorter steps"), "{log:?}");
    let fmu = grumbler(Trouble::Rounds);
    fmu.enter_initialization(0.0, None);
    assert_eq!(fmu.fmi2ExitInitializationMode(), Status::Error);
    let log = fmu.take_log();
    assert!(
        log.iter().any(|message| message.text.contains("does not come to an end in 10000 rounds")),
        "{log:?}"
    );
}

/// A model that ends every step early, or at an event if its input is 1, and declares neither.
mod hasty {
    use fmu_export::*;

    #[derive(Clone)]
    pub struct Hasty {
        u: f64,
    }

    variables! { for Hasty;
        /// Input
        u = input(&NUMBER) in u;
    }

    impl Model for Hasty {
        const INFO: Info = Info::new("Hasty", "hasty", "{hasty}");

        fn new(_: &Setup) -> Result<Self, Error> {
            Ok(Self { u: 0.0 })
        }
    }

    impl CoSimulation for Hasty {
        fn step(&mut self, step: Step) -> Result<Stepped, Error> {
            Ok(if self.u == 1.0 { Stepped::Event(step.time) } else { Stepped::Early(step.time) })
        }
    }

    offer!(Hasty: CoSimulation);
}

/// Checks that the FMU does not contradict its description: the step is fatal.
#[test]
fn an_early_end_that_the_model_has_not_announced() {
    let (old, new) =
        (Importer::of::<hasty::Hasty>(CoSimulation), fmi3::Importer::of::<hasty::Hasty>(CoSimulation));
    old.initialize(0.0);
    new.initialize(0.0);
    assert_eq!(old.try_step(0.0, 1.0), Status::Fatal);
    assert_eq!(new.try_step(0.0, 1.0), Status::Fatal);
    for log in [old.take_log(), new.take_log()] {
        assert!(log.len() == 1 && log[0].text.contains("const ENDS_EARLY: bool = true"), "{log:?}");
    }
}

/// The message names what an event needs, which an early end does not.
#[test]
#[should_panic(expected = "add `const EVENTS: Events = Events::Stop;` to its impl CoSimulation")]
fn an_event_that_the_model_has_not_declared() {
    let _ = fmu_export::Simulation::<hasty::Hasty>::new().unwrap().set("u", 1.0).unwrap().run(1.0);
}
