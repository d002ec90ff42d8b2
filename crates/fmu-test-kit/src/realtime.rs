//! Whether code may run in a control loop: it must not allocate, not enter the kernel, not lock.
//!
//! * Allocations are counted by an allocator that the test installs: `#[global_allocator] static COUNTING: Counting =
//!   Counting;`, see [`allocations`].
//! * System calls end a copy of the process in which the work is done, see [`without_kernel`].
//! * Locks are words that the source must not have, see [`assert_nothing_to_lock`]: a lock that is free is an atomic
//!   instruction, which no run shows, nor any sanitizer.
//! * Built with `--cfg rtsan` and the RealtimeSanitizer, [`sanitizer`] marks where nothing may be called that can block.

use crate::checks::{inputs, outputs, parameters, start_of};
use crate::{Either, Importer, fmi3};
use fmu_export::{BaseType, Exported};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ffi::c_void;
use std::path::Path;
use std::ptr::null_mut;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator, counting for each thread what it is asked to do.
#[derive(Debug)]
pub struct Counting;

fn count() {
    // Without a destructor the counter is there for as long as its thread.
    ALLOCATIONS.with(|count| count.set(count.get() + 1));
}

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

/// What the work does allocate and free on this thread.
///
/// # Panics
/// When nothing is counted: [`Counting`] is not the allocator of the program.
pub fn allocations(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    drop(std::hint::black_box(Box::new(1)));
    let start = ALLOCATIONS.with(Cell::get);
    assert_eq!(start - before, 2, "allocations are counted");
    work();
    ALLOCATIONS.with(Cell::get) - start
}

/// The tests of a model whose sources are in this package: what runs in a control loop neither allocates nor enters the kernel nor
/// locks. `make sanitize` runs the same loop under the RealtimeSanitizer.
#[macro_export]
macro_rules! control_loop {
    ($model:ty) => {
        #[global_allocator]
        static COUNTING: $crate::realtime::Counting = $crate::realtime::Counting;

        #[test]
        fn the_loop_does_not_allocate() {
            $crate::realtime::assert_no_allocation::<$model>();
        }

        /// Code that only sees its instance needs neither locks nor anything else that instances would share.
        #[test]
        fn the_library_has_nothing_to_lock() {
            let sources = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
            let files = $crate::realtime::assert_nothing_to_lock(&sources);
            assert!(files > 10, "{files} files");
        }

        /// The kernel ends the process at the first system call, so the loop runs in a copy of it.
        #[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
        #[test]
        fn the_loop_makes_no_system_call() {
            $crate::realtime::assert_no_system_call::<$model>();
        }
    };
}

/// A controller's turn: what masters call between two samples.
struct Loop<F: Either> {
    fmu: F,
    state: *mut c_void,
    time: f64,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    /// What is set or was read.
    values: [Vec<f64>; 2],
    parameter: (u32, f64),
    truths: Vec<u32>,
}

impl<F: Either> Loop<F> {
    fn new<M: Exported>() -> Self {
        let (fmu, inputs, outputs) = (F::initialized_at::<M>(0.0), inputs::<M>(), outputs::<M>());
        let parameter = (0..).zip(M::TABLE).find_map(|(place, of)| Some((place, start_of(of)?)));
        Self {
            state: fmu.save(),
            fmu,
            time: 0.0,
            values: [vec![0.0; inputs.len()], vec![0.0; outputs.len()]],
            inputs,
            outputs,
            parameter: parameter.expect("a parameter"),
            truths: parameters::<M>(BaseType::Boolean),
        }
    }

    /// One step of size `h`, with a fresh state saved into an old one.
    fn turn(&mut self, h: f64) {
        let Self { fmu, state, time, values: [set, read], inputs, outputs, .. } = self;
        set.iter_mut().zip(1_u8..).for_each(|(value, i)| *value = (*time * f64::from(i)).sin());
        fmu.set(inputs, set);
        fmu.give_rates(inputs, set);
        fmu.step(*time, h);
        fmu.ok(fmu.try_get(outputs, read));
        fmu.ok(fmu.get_state(state));
        *time += h;
    }

    /// What a master does less often: another parameter, another mode of working, back to a saved state, derivatives.
    fn change(&self, factor: f64) {
        let Self { fmu, parameter: (parameter, start), .. } = self;
        fmu.set(&[*parameter], &[start * factor]);
        self.truths.iter().for_each(|truth| fmu.ok(fmu.set_boolean(*truth, 1)));
        fmu.ok(fmu.set_state(self.state));
        self.outputs.iter().for_each(|output| _ = fmu.rate(*output));
        fmu.partial(self.outputs[0], self.inputs[0]);
    }

    /// A thousand turns with one step size, a thousand with a new one each, changes in between. The largest step sizes
    /// need what stiff models have for them.
    fn run(&mut self) {
        let _context = sanitizer::enter();
        for i in 0..1000 {
            self.turn(1e-3);
            self.turn(1e-4 * f64::from(1 + i));
            if i % 100 == 99 {
                self.change(1.0 + 1e-4 * f64::from(i));
            }
        }
    }
}

impl<F: Either> Drop for Loop<F> {
    fn drop(&mut self) {
        self.fmu.forget(std::mem::replace(&mut self.state, null_mut()));
    }
}

/// Runs the loop of a model in both standards.
///
/// # Panics
/// When it allocates.
pub fn assert_no_allocation<M: Exported>() {
    let (mut old, mut new) = (Loop::<Importer>::new::<M>(), Loop::<fmi3::Importer>::new::<M>());
    assert_eq!([allocations(|| old.run()), allocations(|| new.run())], [0; 2]);
}

/// Runs the loop of a model in both standards.
///
/// # Panics
/// When it makes a system call, or nobody would notice.
#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
pub fn assert_no_system_call<M: Exported>() {
    assert_eq!(without_kernel(&mut || ()), Ended::Exited(0));
    let caught = without_kernel(&mut || drop(std::fs::metadata("/")));
    assert_eq!(caught, Ended::Killed(libc::SIGSYS), "they are caught");
    let (mut old, mut new) = (Loop::<Importer>::new::<M>(), Loop::<fmi3::Importer>::new::<M>());
    assert_eq!(without_kernel(&mut || old.run()), Ended::Exited(0));
    assert_eq!(without_kernel(&mut || new.run()), Ended::Exited(0));
}

/// Looks for locks and for anything else that instances would share in all files of a folder; returns their number.
///
/// # Panics
/// When there is any.
pub fn assert_nothing_to_lock(folder: &Path) -> usize {
    let shared = ["Mutex", "RwLock", "Condvar", "Once", "OnceLock", "LazyLock", "thread_local"];
    let mut folders = vec![folder.to_owned()];
    let mut files = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a readable folder") {
            let path = entry.expect("a readable folder").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            files += 1;
            let text = std::fs::read_to_string(&path).expect("a readable file");
            // Each instance has a WebAssembly module for itself: nothing in it is shared.
            if text.contains("#![cfg(target_family = \"wasm\")]") {
                continue;
            }
            for word in text.split(|c: char| !c.is_alphanumeric() && c != '_') {
                let found = shared.contains(&word) || word.starts_with("Atomic");
                assert!(!found, "{} has {word}", path.display());
            }
            assert!(!text.contains("static mut"), "{} has static mut", path.display());
        }
    }
    files
}

/// Tells the RealtimeSanitizer, if this was built with it (`--cfg rtsan`), that nothing may be called that can block.
pub mod sanitizer {
    /// Until this is dropped.
    #[derive(Debug)]
    #[must_use]
    pub struct Context;

    #[cfg(rtsan)]
    unsafe extern "C" {
        fn __rtsan_realtime_enter();
        fn __rtsan_realtime_exit();
    }

    /// From here on.
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
}

#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
pub use sandbox::{Ended, without_kernel};

#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
mod sandbox {
    use libc::{BPF_ABS, BPF_JEQ, BPF_JMP, BPF_K, BPF_LD, BPF_RET, BPF_W, sock_filter, sock_fprog};

    /// How a process ended.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum Ended {
        /// By itself, with this code.
        Exited(i32),
        /// By this signal; SIGSYS after a system call.
        Killed(i32),
    }

    /// Does the work in a copy of this process that may make no system call but the last.
    ///
    /// # Panics
    /// When there is no copy to be had.
    pub fn without_kernel(work: &mut dyn FnMut()) -> Ended {
        // SAFETY: the child does the work and exits; if the work allocates or locks, as another thread might be doing
        // at this moment, the test is lost anyway.
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
            Ended::Exited(libc::WEXITSTATUS(status))
        } else {
            Ended::Killed(libc::WTERMSIG(status))
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
