//! What runs in a control loop neither allocates nor enters the kernel nor locks. `make sanitize` runs the same loop
//! under the RealtimeSanitizer.
#![allow(missing_docs)]

mod toys;

use fmu_export::Interface::CoSimulation;
use fmu_export::fmi2::types::*;
use fmu_run::Importer;
use fmu_run::realtime::*;
use std::path::Path;
use std::ptr::null_mut;
use toys::{Oscillator, oscillator::Name};

#[global_allocator]
static COUNTING: Counting = Counting;

const FORCE: u32 = Name::force as u32;
const STIFFNESS: u32 = Name::stiffness as u32;
const OUTPUTS: [u32; 3] = [Name::position as u32, Name::spring_force as u32, Name::energy as u32];

/// A controller's turn: what masters call between two samples.
struct Loop {
    fmu: Importer,
    state: fmi2FMUstate,
    time: f64,
}

impl Loop {
    fn new() -> Self {
        let fmu = Importer::of::<Oscillator>(CoSimulation);
        fmu.initialize(0.0);
        let state = fmu.save();
        Self { fmu, state, time: 0.0 }
    }

    /// One step of size `h`, with a fresh state saved into an old one.
    fn turn(&mut self, h: f64) {
        let Self { fmu, state, time } = self;
        fmu.set(&[FORCE], &[time.sin()]);
        fmu.set_rates([FORCE], [time.cos()]);
        fmu.step(*time, h);
        fmu.get(OUTPUTS);
        fmu.ok(fmu.fmi2GetFMUstate(state));
        *time += h;
    }

    /// What a master does less often: another parameter, back to a saved state, derivatives.
    fn change(&self, stiffness: f64) {
        let fmu = &self.fmu;
        fmu.set(&[STIFFNESS], &[stiffness]);
        fmu.ok(fmu.fmi2SetBoolean(&(Name::damped as u32), 1, &fmi2True));
        fmu.ok(fmu.fmi2SetFMUstate(self.state));
        fmu.rates(OUTPUTS);
        let (unknown, known) = (Name::der_velocity as u32, FORCE);
        fmu.ok(fmu.fmi2GetDirectionalDerivative(&unknown, 1, &known, 1, &1.0, &mut 0.0));
    }

    /// A thousand turns with one step size, a thousand with a new one each, changes in between.
    fn run(&mut self) {
        let _context = sanitizer::enter();
        for i in 0..1000 {
            self.turn(1e-3);
            self.turn(1e-4 * f64::from(1 + i));
            if i % 100 == 99 {
                self.change(100.0 + f64::from(i));
            }
        }
    }
}

impl Drop for Loop {
    fn drop(&mut self) {
        self.fmu.forget(std::mem::replace(&mut self.state, null_mut()));
    }
}

#[test]
fn the_loop_does_not_allocate() {
    let mut control = Loop::new();
    assert_eq!(allocations(|| control.run()), 0);
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(1)))), 2);
}

/// Code that only sees its instance needs neither locks nor anything else that instances would share.
#[test]
fn the_library_has_nothing_to_lock() {
    let files = assert_nothing_to_lock(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    assert!(files > 20, "{files} files");
}

/// The kernel ends the process at the first system call, so the loop runs in a copy of it.
#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
#[test]
fn the_loop_makes_no_system_call() {
    const SIGSYS: i32 = 31;
    let mut control = Loop::new();
    assert_eq!(without_kernel(&mut || ()), Ended::Exited(0));
    assert_eq!(
        without_kernel(&mut || drop(std::fs::metadata("/"))),
        Ended::Killed(SIGSYS),
        "they are caught"
    );
    assert_eq!(without_kernel(&mut || control.run()), Ended::Exited(0));
}

#[cfg(rtsan)]
#[test]
#[ignore = "the sanitizer must end it, and does if make sanitize goes on"]
fn allocation_is_caught() {
    let _context = sanitizer::enter();
    drop(std::hint::black_box(Box::new(1)));
}
