//! What runs in a control loop neither allocates nor enters the kernel nor locks. `make sanitize` runs the same loop
//! under the RealtimeSanitizer.

use fmu_export::Interface::CoSimulation;
use fmu_export::fmi2::types::*;
use fmu_run::Importer;
use fmu_run::realtime::*;
use prw_testbed::TestbedFmu;
use prw_testbed::variables::Name;
use std::path::Path;
use std::ptr::null_mut;

#[global_allocator]
static COUNTING: Counting = Counting;

const fn vr(name: Name) -> u32 {
    name as u32
}

/// A controller's turn: what masters call between two samples.
struct Loop {
    fmu: Importer,
    state: fmi2FMUstate,
    time: f64,
}

impl Loop {
    fn new() -> Self {
        let fmu = Importer::of::<TestbedFmu>(CoSimulation);
        fmu.initialize(0.0);
        let state = fmu.save();
        Self { fmu, state, time: 0.0 }
    }

    /// One step of size `h`, with a fresh state saved into an old one.
    fn turn(&mut self, h: f64) {
        let Self { fmu, state, time } = self;
        fmu.set(&[vr(Name::theta1), vr(Name::theta2)], &[time.sin(), 0.3 * *time]);
        fmu.set_rates([vr(Name::theta1), vr(Name::theta2)], [time.cos(), 0.3]);
        fmu.step(*time, h);
        fmu.get([vr(Name::tau1), vr(Name::tau2), vr(Name::pitch), vr(Name::roll)]);
        fmu.ok(fmu.fmi2GetFMUstate(state));
        *time += h;
    }

    /// What a master does less often: another parameter, another source of the rates, back to a saved
    /// state.
    fn change(&self, k1: f64) {
        let fmu = &self.fmu;
        fmu.set(&[vr(Name::k1)], &[k1]);
        fmu.ok(fmu.fmi2SetBoolean(&vr(Name::use_omega), 1, &fmi2True));
        fmu.ok(fmu.fmi2SetFMUstate(self.state));
        fmu.rates([vr(Name::tau1), vr(Name::theta3)]);
        let (tau, theta, mut gain) = ([vr(Name::tau1)], [vr(Name::theta1)], [0.0]);
        fmu.ok(fmu.fmi2GetDirectionalDerivative(
            tau.as_ptr(),
            1,
            theta.as_ptr(),
            1,
            [1.0].as_ptr(),
            gain.as_mut_ptr(),
        ));
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

impl Drop for Loop {
    fn drop(&mut self) {
        self.fmu.forget(std::mem::replace(&mut self.state, null_mut()));
    }
}

#[test]
fn the_loop_does_not_allocate() {
    let mut control = Loop::new();
    assert_eq!(allocations(|| control.run()), 0);
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
    let mut control = Loop::new();
    assert!(
        matches!(without_kernel(&mut || drop(std::fs::metadata("/"))), Ended::Killed(_)),
        "they are caught"
    );
    assert_eq!(without_kernel(&mut || control.run()), Ended::Exited(0));
}
