//! Masters create, step and free instances on pools of threads.

use crate::models::{Oscillator, oscillator::Name};
use fmu_export::Interface::ModelExchange;
use fmu_test_kit::{Either, Importer, fmi3};
use std::sync::Mutex;

const THREADS: usize = 4;
const INSTANCES: usize = 8;
const TURNS: usize = 400;

/// An instance on its way through the pool: with an even number one of FMI 2.0, with an odd one of FMI 3.0.
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

    /// The state as bytes, unlike that of any other number or any other count of steps.
    fn bytes(number: usize, steps: usize) -> Vec<u8> {
        let mut job = Self::new(number);
        (0..steps).for_each(|_| job.step());
        job.fmu.bytes()
    }
}

/// Whichever thread steps an instance, its state has the same bits as without threads.
///
/// Threads never wait for a lock, they try the next instance: the ThreadSanitizer cannot see into the part of the
/// standard library that waits.
#[test]
fn instances_go_from_thread_to_thread() {
    let pool: Vec<_> = (0..INSTANCES).map(|number| Mutex::new(Job::new(number))).collect();
    let work = &|thread: usize| {
        for turn in 0..TURNS {
            let next = (turn * (thread + 1) % INSTANCES..).map(|at| pool[at % INSTANCES].try_lock());
            let mut job = next.flatten().next().expect("fewer threads than instances");
            (0..3).for_each(|_| job.step());
            // Some are freed where they are; others take their place.
            if turn % 37 == thread {
                *job = Job::new(job.number);
                drop(Importer::of::<Oscillator>(ModelExchange));
                drop(fmi3::Importer::of::<Oscillator>(ModelExchange));
            }
        }
    };
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..THREADS).map(|thread| scope.spawn(move || work(thread))).collect();
        threads.into_iter().for_each(|thread| thread.join().unwrap());
    });
    let jobs: Vec<_> = pool.into_iter().map(|job| job.into_inner().unwrap()).collect();
    // In both standards.
    assert!((0..2).all(|odd| jobs.iter().any(|job| job.number % 2 == odd && job.steps > 0)));
    for Job { fmu, number, steps } in jobs {
        assert_eq!(fmu.bytes(), Job::bytes(number, steps), "instance {number} after {steps} steps");
    }
}
