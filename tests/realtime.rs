//! What runs in a control loop neither allocates nor enters the kernel nor locks. `make sanitize` runs the same loop
//! under the RealtimeSanitizer.

use fmu_test_kit::either::Either;
use fmu_test_kit::realtime::*;
use fmu_test_kit::{Importer, fmi3};
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;
use std::ffi::c_void;
use std::path::Path;
use std::ptr::null_mut;

#[global_allocator]
static COUNTING: Counting = Counting;

const fn vr(name: Name) -> u32 {
    name as u32
}

/// A controller's turn: what masters call between two samples.
struct Loop<F: Either> {
    fmu: F,
    state: *mut c_void,
    time: f64,
}

impl<F: Either> Loop<F> {
    fn new() -> Self {
        let (fmu, mut state) = (F::initialized::<TestbedFmu>(), null_mut());
        fmu.save_into(&mut state);
        Self { fmu, state, time: 0.0 }
    }

    /// One step of size `h`, with a fresh state saved into an old one.
    fn turn(&mut self, h: f64) {
        let Self { fmu, state, time } = self;
        fmu.write(&[vr(Name::theta1), vr(Name::theta2)], &[time.sin(), 0.3 * *time]);
        fmu.write_rates(&[vr(Name::theta1), vr(Name::theta2)], &[time.cos(), 0.3]);
        fmu.advance(*time, h);
        fmu.read(&[vr(Name::tau1), vr(Name::tau2), vr(Name::pitch), vr(Name::roll)], &mut [0.0; 4]);
        fmu.save_into(state);
        *time += h;
    }

    /// What a master does less often: another parameter, another source of the rates, back to a saved
    /// state.
    fn change(&self, k1: f64) {
        let fmu = &self.fmu;
        fmu.write(&[vr(Name::k1)], &[k1]);
        fmu.decide(vr(Name::use_omega), true);
        fmu.go_back(self.state);
        [vr(Name::tau1), vr(Name::theta3)].iter().for_each(|output| _ = fmu.read_rate(*output));
        fmu.read_partial(vr(Name::tau1), vr(Name::theta1));
    }

    /// A thousand turns with one step size, a thousand with a new one each, changes in between. The
    /// largest step sizes need the step matrices for stiff testbeds.
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
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(1)))), 2, "allocations are counted");
}

#[test]
fn the_library_has_nothing_to_lock() {
    let files = assert_nothing_to_lock(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"));
    assert!(files > 10, "{files} files");
}

#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
#[test]
fn the_loop_makes_no_system_call() {
    let (mut old, mut new) = (Loop::<Importer>::new(), Loop::<fmi3::Importer>::new());
    assert!(
        matches!(without_kernel(&mut || drop(std::fs::metadata("/"))), Ended::Killed(_)),
        "they are caught"
    );
    assert_eq!(without_kernel(&mut || old.run()), Ended::Exited(0));
    assert_eq!(without_kernel(&mut || new.run()), Ended::Exited(0));
}
