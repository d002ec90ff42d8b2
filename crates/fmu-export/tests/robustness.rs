//! Test models with random calls in random order, and on several threads.
#![allow(missing_docs)]

use fmu_test_kit::models;

use fmu_export::Interface::ModelExchange;
use fmu_test_kit::fault_injection::{RunBytes, Tally, run, run_seeds};
use fmu_test_kit::{Either, FUNCTIONS, Importer, fmi3};
use models::{oscillator::Name, *};
use std::io::{Cursor, Read as _};
use std::sync::Mutex;

macro_rules! models {
    ($importer:ty: $($model:ident)+) => { &[$((stringify!($model), run::<$importer, $model>)),+] };
}

const MODELS: &[(&str, RunBytes)] =
    models!(Importer: Oscillator Ball Counter Talker Fuse Lazy Motor Rod Meter);

const MODELS_OF_FMI3: &[(&str, RunBytes)] =
    models!(fmi3::Importer: Oscillator Ball Counter Talker Fuse Palette Motor Rod Meter);

/// Functions that never return OK, because steps are synchronous, no model has clocks, and the library does not provide
/// per-element dependencies or `fmi3EvaluateDiscreteStates`.
const NEVER: &str = "fmi2CancelStep fmi2GetStatus fmi2GetIntegerStatus fmi2GetStringStatus fmi3GetClock \
    fmi3SetClock fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies fmi3GetIntervalDecimal \
    fmi3GetIntervalFraction fmi3GetShiftDecimal fmi3GetShiftFraction fmi3SetIntervalDecimal \
    fmi3SetIntervalFraction fmi3SetShiftDecimal fmi3SetShiftFraction fmi3EvaluateDiscreteStates \
    fmi3ActivateModelPartition";

/// Checks that every function was accepted at least once, except those in `NEVER`, and rejected at least once.
fn check_counts(tally: &Tally, functions: &[&str]) {
    for name in functions {
        let [ok, _, rejected] = tally[name];
        assert_eq!(ok == 0, NEVER.split(' ').any(|never| never == *name), "{name}: {:?}", tally[name]);
        assert!(rejected > 0, "{name} is never rejected");
    }
}

#[test]
fn every_guarantee_holds_for_any_calls() {
    let tally = run_seeds(3, MODELS);
    assert_eq!(tally.len(), 44, "every function must be called");
    check_counts(&tally, FUNCTIONS);
}

#[test]
fn every_guarantee_of_fmi3_holds_for_any_calls() {
    let tally = run_seeds(3, MODELS_OF_FMI3);
    check_counts(&tally, fmi3::FUNCTIONS);
    check_counts(&tally, &["fmi3InstantiateCoSimulation", "fmi3InstantiateModelExchange"]);
}

/// Runs the inputs that libFuzzer has collected, each with every model of both lists.
#[test]
fn every_guarantee_holds_for_the_corpus() {
    let archive = include_bytes!("../fuzz/corpus.zip");
    let mut archive = zip::ZipArchive::new(Cursor::new(archive)).expect("a zip archive");
    let mut tally = Tally::new();
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).expect("a file of the archive");
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).expect("an intact file");
        for (model, session) in MODELS.iter().chain(MODELS_OF_FMI3) {
            println!("{model}, {:?}", file.name());
            session(&bytes, &mut tally);
        }
    }
    assert!(!tally.is_empty(), "the corpus is empty");
}

const THREADS: usize = 4;
const INSTANCES: usize = 8;
const TURNS: usize = 400;

/// An instance in the pool: of FMI 2.0 if its number is even, of FMI 3.0 if it is odd.
struct Job {
    fmu: Box<dyn Either>,
    number: usize,
    steps: usize,
}

impl Job {
    fn new(number: usize) -> Self {
        let fmu: Box<dyn Either> = match number % 2 {
            0 => Box::new(Importer::initialized_at::<Oscillator>(0.0)),
            _ => Box::new(fmi3::Importer::initialized_at::<Oscillator>(0.0)),
        };
        Self { fmu, number, steps: 0 }
    }

    fn step(&mut self) {
        let time = self.steps as f64 / 256.0;
        self.fmu.set(&[Name::force as u32], &[(time * self.number as f64).sin() + time]);
        self.fmu.step(time, 1.0 / 256.0);
        self.steps += 1;
    }

    /// Returns the state after this number of steps, which is different for each instance and each number of steps.
    fn bytes(number: usize, steps: usize) -> Vec<u8> {
        let mut job = Self::new(number);
        (0..steps).for_each(|_| job.step());
        job.fmu.bytes()
    }
}

/// Checks that the state of an instance does not depend on which threads step it.
///
/// Threads never wait for a lock, because the ThreadSanitizer cannot observe the part of the standard library that waits.
#[test]
fn threads_pass_instances_on() {
    let pool: Vec<_> = (0..INSTANCES).map(|number| Mutex::new(Job::new(number))).collect();
    let work = &|thread: usize| {
        for turn in 0..TURNS {
            let next = (turn * (thread + 1) % INSTANCES..).map(|at| pool[at % INSTANCES].try_lock());
            let mut job = next.flatten().next().expect("there must be fewer threads than instances");
            (0..3).for_each(|_| job.step());
            // Frees and replaces some instances, and creates and frees others.
            if turn % 37 == thread {
                *job = Job::new(job.number);
                drop(Importer::new::<Oscillator>(ModelExchange));
                drop(fmi3::Importer::new::<Oscillator>(ModelExchange));
            }
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|thread| scope.spawn(move || work(thread))).collect();
        threads.into_iter().for_each(|thread| thread.join().unwrap());
    });
    let jobs: Vec<_> = pool.into_iter().map(|job| job.into_inner().unwrap()).collect();
    assert!((0..2).all(|odd| jobs.iter().any(|job| job.number % 2 == odd && job.steps > 0)));
    for Job { fmu, number, steps } in jobs {
        assert_eq!(fmu.bytes(), Job::bytes(number, steps), "instance {number} after {steps} steps");
    }
}
