//! What runs in a control loop neither allocates nor enters the kernel nor locks. `make sanitize` runs the
//! same loop under the RealtimeSanitizer.

use crate::support::Fmu;
use fmi2_export::Interface::CoSimulation;
use fmi2_export::types::*;
use prw_testbed::variables::vr;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ptr::null_mut;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting for each thread what it is asked to do.
struct Counting;

#[global_allocator]
static COUNTING: Counting = Counting;

fn count() {
    // Without a destructor the counter is there for as long as its thread.
    ALLOCATIONS.with(|count| count.set(count.get() + 1));
}

#[allow(unsafe_code)]
// SAFETY: hands everything on to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller's promise is that of the same function.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: as above.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

fn allocations() -> u64 {
    ALLOCATIONS.with(Cell::get)
}

/// A controller's turn: what masters call between two samples.
struct Loop {
    fmu: Fmu,
    state: fmi2FMUstate,
    time: f64,
}

impl Loop {
    fn new() -> Self {
        let fmu = Fmu::new(CoSimulation);
        fmu.initialize(0.0);
        let state = fmu.save();
        Self { fmu, state, time: 0.0 }
    }

    /// One step of size `h`, with a fresh state saved into an old one.
    fn turn(&mut self, h: f64) {
        let Self { fmu, state, time } = self;
        fmu.set(&[vr::theta1, vr::theta2], &[time.sin(), 0.3 * *time]);
        fmu.set_rates([vr::theta1, vr::theta2], [time.cos(), 0.3]);
        fmu.step(*time, h);
        fmu.get([vr::tau1, vr::tau2, vr::pitch, vr::roll]);
        fmu.ok(fmu.fmi2GetFMUstate(state));
        *time += h;
    }

    /// What a master does less often: another parameter, another source of the rates, back to a saved
    /// state.
    fn change(&self, k1: f64) {
        let fmu = &self.fmu;
        fmu.set(&[vr::k1], &[k1]);
        fmu.ok(fmu.fmi2SetBoolean(&vr::use_omega, 1, &fmi2True));
        fmu.ok(fmu.fmi2SetFMUstate(self.state));
        fmu.rates([vr::tau1, vr::theta3]);
        let (tau, theta, mut gain) = ([vr::tau1], [vr::theta1], [0.0]);
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

/// Tells the RealtimeSanitizer, if this test was built with it (`--cfg rtsan`), that from here on nothing
/// may be called that can block.
#[allow(unexpected_cfgs, reason = "make sanitize sets it")]
#[allow(unsafe_code)]
mod sanitizer {
    pub struct Context;

    #[cfg(rtsan)]
    unsafe extern "C" {
        fn __rtsan_realtime_enter();
        fn __rtsan_realtime_exit();
    }

    pub fn enter() -> Context {
        // SAFETY: marks the thread, no more.
        #[cfg(rtsan)]
        unsafe {
            __rtsan_realtime_enter()
        }
        Context
    }

    impl Drop for Context {
        fn drop(&mut self) {
            // SAFETY: as above.
            #[cfg(rtsan)]
            unsafe {
                __rtsan_realtime_exit()
            }
        }
    }

    #[cfg(rtsan)]
    #[test]
    #[ignore = "the sanitizer must end it, and does if make sanitize goes on"]
    fn allocation_is_caught() {
        let _context = enter();
        drop(std::hint::black_box(Box::new(1)));
    }
}

#[test]
fn the_loop_does_not_allocate() {
    let before = allocations();
    drop(std::hint::black_box(Box::new(1)));
    assert_eq!(allocations() - before, 2, "allocations are counted");

    let mut control = Loop::new();
    let before = allocations();
    control.run();
    assert_eq!(allocations() - before, 0);
}

/// A Rust lock that is free is an atomic instruction, which no run shows, nor any sanitizer. Code that only
/// sees its instance needs neither locks nor anything else that instances would share.
#[test]
fn the_library_has_nothing_to_lock() {
    let shared = ["Mutex", "RwLock", "Condvar", "Once", "OnceLock", "LazyLock", "thread_local"];
    let mut folders = vec!["src".to_owned(), "crates/fmi2-export/src".to_owned()];
    let mut files = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("tests run in the package's folder") {
            let path = entry.expect("a readable folder").path();
            let name = path.to_str().expect("ASCII").to_owned();
            if path.is_dir() {
                folders.push(name);
                continue;
            }
            files += 1;
            let text = std::fs::read_to_string(&path).expect("a readable file");
            for word in text.split(|c: char| !c.is_alphanumeric() && c != '_') {
                assert!(!shared.contains(&word) && !word.starts_with("Atomic"), "{name} has {word}");
            }
            assert!(!text.contains("static mut"), "{name} has static mut");
        }
    }
    assert!(files > 20, "{files} files");
}

/// The kernel ends the process at the first system call, so the loop runs in a copy of it.
#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
#[test]
fn the_loop_makes_no_system_call() {
    let mut control = Loop::new();
    let without_kernel = |work: &mut dyn FnMut()| sandbox::status(work);
    assert_eq!(without_kernel(&mut || ()), sandbox::Status::Exited(0));
    let caught = without_kernel(&mut || drop(std::fs::metadata("/")));
    assert_eq!(caught, sandbox::Status::Killed(libc::SIGSYS), "system calls are caught");
    assert_eq!(without_kernel(&mut || control.run()), sandbox::Status::Exited(0));
}

#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
#[allow(unsafe_code)]
mod sandbox {
    use libc::{BPF_ABS, BPF_JEQ, BPF_JMP, BPF_K, BPF_LD, BPF_RET, BPF_W, sock_filter, sock_fprog};

    /// How a process ended.
    #[derive(Debug, PartialEq)]
    pub enum Status {
        Exited(i32),
        Killed(i32),
    }

    /// Does the work in a copy of this process that may make no system call but the last.
    pub fn status(work: &mut dyn FnMut()) -> Status {
        // SAFETY: the child does the work and exits; if the work allocates or locks, as the other thread
        // might be doing at this moment, the test is lost anyway.
        let child = unsafe { libc::fork() };
        assert!(child >= 0, "fork: {}", std::io::Error::last_os_error());
        if child == 0 {
            let code = if allow_exit_only() {
                work();
                0
            } else {
                1
            };
            // SAFETY: ends the process.
            unsafe { libc::_exit(code) }
        }
        let mut status = 0;
        // SAFETY: the child of above and a place for its status.
        assert_eq!(unsafe { libc::waitpid(child, &raw mut status, 0) }, child);
        if libc::WIFEXITED(status) {
            Status::Exited(libc::WEXITSTATUS(status))
        } else {
            Status::Killed(libc::WTERMSIG(status))
        }
    }

    fn allow_exit_only() -> bool {
        let statement = |code: u32, k: u32, jt, jf| sock_filter { code: code as u16, jt, jf, k };
        let mut filter = [
            statement(BPF_LD | BPF_W | BPF_ABS, 0, 0, 0), // the number of the system call
            statement(BPF_JMP | BPF_JEQ | BPF_K, libc::SYS_exit_group as u32, 0, 1),
            statement(BPF_RET | BPF_K, libc::SECCOMP_RET_ALLOW, 0, 0),
            statement(BPF_RET | BPF_K, libc::SECCOMP_RET_KILL_PROCESS, 0, 0),
        ];
        let program = sock_fprog { len: filter.len() as u16, filter: filter.as_mut_ptr() };
        // SAFETY: both only restrict this process; the program is copied.
        unsafe {
            libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
                && libc::prctl(libc::PR_SET_SECCOMP, libc::SECCOMP_MODE_FILTER, &raw const program) == 0
        }
    }
}
