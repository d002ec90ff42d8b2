//! Importers that call one instance from two threads at the same time, although FMI forbids it.
#![allow(missing_docs)]

use fmu_export::*;
use fmu_test_kit::models::{Talker, talker::Name};
use fmu_test_kit::{Arguments, Either, Importer, fmi3};
use std::ptr::null_mut;
use std::sync::Barrier;

/// Both threads wait here at the begin and at the end of each step of [`Waiting`].
static IN_STEP: Barrier = Barrier::new(2);

/// Makes steps during which another thread can call the instance.
#[derive(Clone)]
struct Waiting {
    time: f64,
}

mod waiting {
    use super::Waiting;
    use fmu_export::*;

    variables! { for Waiting;
        /// End of the last step
        time = output(&TIME) in time;
    }
}

impl Model for Waiting {
    const INFO: Info = info!("Waiting", "waiting");

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { time: 0.0 })
    }
}

impl CoSimulation for Waiting {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        IN_STEP.wait();
        self.time = step.time + step.size;
        IN_STEP.wait();
        Ok(Stepped::Done)
    }
}

offer!(Waiting: CoSimulation);

/// An instance that two threads use at the same time.
struct Shared<F>(F);

// SAFETY: not true for an importer that keeps the contract of FMI; these tests break it on purpose.
unsafe impl<F> Sync for Shared<F> {}

impl<F> Shared<F> {
    fn fmu(&self) -> &F {
        &self.0
    }
}

/// Calls every function, also the one that frees the instance, while a step runs on another thread.
fn check_calls_during_a_step<F: Either>(free: unsafe fn(&F)) {
    let shared = Shared(F::initialized_at::<Waiting>(0.0));
    let (status, calls) = std::thread::scope(|scope| {
        let step = scope.spawn(|| shared.fmu().try_step(0.0, 0.5));
        IN_STEP.wait();
        let fmu = shared.fmu();
        let calls = fmu.call_all();
        // SAFETY: the FMU ignores the call, because another thread uses the instance.
        unsafe { free(fmu) };
        IN_STEP.wait();
        (step.join().unwrap(), calls)
    });
    let fmu = shared.fmu();
    assert_eq!(status, Status::Ok);
    let log = fmu.take_log();
    assert_eq!(log.len(), calls.len() + 1);
    for ((name, status), message) in calls.iter().zip(&log) {
        assert_eq!((*status, message.status), (Status::Error, Status::Error), "{name}");
        let why =
            ": another thread is calling this instance; make the calls on an instance one after another";
        assert_eq!(message.message, format!("{name}{why}"));
        message.assert_clean();
    }
    assert!(log.last().is_some_and(|message| message.message.contains("FreeInstance: another thread")));
    let mut end = [0.0];
    assert_eq!((fmu.try_get(&[0], &mut end), end), (Status::Ok, [0.5]));
}

#[test]
fn calls_during_a_step_are_rejected() {
    // SAFETY: called only during a step on another thread, and then ignored.
    check_calls_during_a_step::<Importer>(|fmu| unsafe { fmu.free() });
    // SAFETY: called only during a step on another thread, and then ignored.
    check_calls_during_a_step::<fmi3::Importer>(|fmu| unsafe { fmu.free() });
}

/// Makes calls that allocate and free memory, on two threads without any order. The instance must survive, and each call must
/// be carried out or rejected as a whole.
fn hammer<F: Either>() {
    let arguments = Arguments { logging_on: 1, ..Arguments::new::<Talker>(Interface::CoSimulation) };
    let shared = Shared(F::make::<Talker>(&arguments).unwrap());
    shared.fmu().initialize(0.0);
    let together = Barrier::new(2);
    std::thread::scope(|scope| {
        for thread in 0..2 {
            let (shared, together) = (&shared, &together);
            scope.spawn(move || {
                together.wait();
                let fmu = shared.fmu();
                for turn in 0..5000 {
                    let mut state = null_mut();
                    let saved = fmu.get_state(&mut state);
                    assert_eq!(saved == Status::Ok, !state.is_null());
                    fmu.try_set(&[Name::volume as u32], &[f64::from(10 + (turn + thread) % 2)]);
                    fmu.try_step(f64::from(turn), 1.0);
                    fmu.try_get(&[Name::decibels as u32], &mut [0.0]);
                    fmu.set_state(state);
                    while !state.is_null() {
                        fmu.free_state(&mut state);
                    }
                    fmu.reset();
                    fmu.enter_initialization_mode(0.0, None);
                }
            });
        }
    });
    let fmu = shared.fmu();
    fmu.ok(fmu.reset());
    let other = F::make::<Talker>(&arguments).unwrap();
    assert_eq!(fmu.bytes(), other.bytes());
}

#[test]
fn an_instance_survives_two_threads() {
    hammer::<Importer>();
    hammer::<fmi3::Importer>();
}
