//! What runs in a control loop neither allocates nor enters the kernel nor locks. `make sanitize` runs the same loop
//! under the RealtimeSanitizer.
#![allow(missing_docs)]

mod toys;

use fmu_test_kit::either::Either;
use fmu_test_kit::realtime::*;
use fmu_test_kit::{Importer, fmi3};
use std::ffi::c_void;
use std::path::Path;
use std::ptr::null_mut;
use toys::{Oscillator, oscillator::Name};

#[global_allocator]
static COUNTING: Counting = Counting;

const FORCE: u32 = Name::force as u32;
const STIFFNESS: u32 = Name::stiffness as u32;
const OUTPUTS: [u32; 3] = [Name::position as u32, Name::spring_force as u32, Name::energy as u32];

/// A controller's turn: what masters call between two samples.
struct Loop<F: Either> {
    fmu: F,
    state: *mut c_void,
    time: f64,
}

impl<F: Either> Loop<F> {
    fn new() -> Self {
        let (fmu, mut state) = (F::initialized::<Oscillator>(), null_mut());
        fmu.save_into(&mut state);
        Self { fmu, state, time: 0.0 }
    }

    /// One step of size `h`, with a fresh state saved into an old one.
    fn turn(&mut self, h: f64) {
        let Self { fmu, state, time } = self;
        fmu.write(&[FORCE], &[time.sin()]);
        fmu.write_rates(&[FORCE], &[time.cos()]);
        fmu.advance(*time, h);
        fmu.read(&OUTPUTS, &mut [0.0; 3]);
        fmu.save_into(state);
        *time += h;
    }

    /// What a master does less often: another parameter, back to a saved state, derivatives.
    fn change(&self, stiffness: f64) {
        let fmu = &self.fmu;
        fmu.write(&[STIFFNESS], &[stiffness]);
        fmu.decide(Name::damped as u32, true);
        fmu.go_back(self.state);
        OUTPUTS.iter().for_each(|output| _ = fmu.read_rate(*output));
        fmu.read_partial(Name::der_velocity as u32, FORCE);
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

impl<F: Either> Drop for Loop<F> {
    fn drop(&mut self) {
        self.fmu.free(std::mem::replace(&mut self.state, null_mut()));
    }
}

fn does_not_allocate<F: Either>() {
    let mut control = Loop::<F>::new();
    assert_eq!(allocations(|| control.run()), 0);
}

#[test]
fn the_loop_does_not_allocate() {
    does_not_allocate::<Importer>();
    does_not_allocate::<fmi3::Importer>();
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
    assert_eq!(without_kernel(&mut || ()), Ended::Exited(0));
    assert_eq!(
        without_kernel(&mut || drop(std::fs::metadata("/"))),
        Ended::Killed(SIGSYS),
        "they are caught"
    );
    let (mut old, mut new) = (Loop::<Importer>::new(), Loop::<fmi3::Importer>::new());
    assert_eq!(without_kernel(&mut || old.run()), Ended::Exited(0));
    assert_eq!(without_kernel(&mut || new.run()), Ended::Exited(0));
}

#[cfg(rtsan)]
#[test]
#[ignore = "the sanitizer must end it, and does if make sanitize goes on"]
fn allocation_is_caught() {
    let _context = sanitizer::enter();
    drop(std::hint::black_box(Box::new(1)));
}
