//! Checks that code may run in a control loop: it must not allocate, make system calls, or lock.
//!
//! * An allocator that the test installs counts allocations:
//!   `#[global_allocator] static COUNTING: Counting = Counting;`, see [`allocations`].
//! * The work runs in a copy of the process that the kernel ends at the first system call, see
//!   [`without_kernel`].
//! * The source must not contain the names of locks, see [`assert_nothing_to_lock`]. The source is searched because
//!   taking a free lock is only an atomic instruction, which cannot be detected at run time.
//! * In a build with `--cfg rtsan` and the RealtimeSanitizer, [`sanitizer`] marks the code in which blocking
//!   calls are forbidden.

use crate::checks::{boolean_parameters, inputs, outputs, start_of};
use crate::{Either, Importer, fmi3};
use fmu_export::Exported;
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ffi::c_void;
use std::path::Path;
use std::ptr::null_mut;

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

/// The system's allocator with a count of its calls for each thread.
#[derive(Debug)]
pub struct Counting;

fn count() {
    // The counter has no destructor, so it is valid until its thread ends.
    ALLOCATIONS.with(|count| count.set(count.get() + 1));
}

// SAFETY: all calls are passed to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count();
        // SAFETY: the caller guarantees the requirements of the same function.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count();
        // SAFETY: the caller guarantees the requirements of the same function.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count();
        // SAFETY: the caller guarantees the requirements of the same function.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

/// Returns the number of allocations and deallocations by `work` on this thread.
///
/// # Panics
/// Panics if [`Counting`] is not the allocator of the program.
pub fn allocations(work: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    drop(std::hint::black_box(Box::new(1)));
    let start = ALLOCATIONS.with(Cell::get);
    assert_eq!(start - before, 2, "the test must install the allocator `Counting`");
    work();
    ALLOCATIONS.with(Cell::get) - start
}

/// Defines tests of a control loop with a model, which must not allocate, make system calls, or lock. The sources of the
/// model must be in the package of the test. `make sanitize` runs the same loop under the RealtimeSanitizer.
#[macro_export]
macro_rules! control_loop {
    ($model:ty) => {
        #[global_allocator]
        static COUNTING: $crate::realtime::Counting = $crate::realtime::Counting;

        #[test]
        fn the_loop_does_not_allocate() {
            $crate::realtime::assert_no_allocation::<$model>();
        }

        /// Checks that the sources contain no data that instances share, so that no locks are needed.
        #[test]
        fn the_library_has_nothing_to_lock() {
            let sources = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
            let files = $crate::realtime::assert_nothing_to_lock(&sources);
            assert!(files > 10, "{files} files");
        }

        /// Runs the loop in a copy of the process, because the kernel ends the process at the first system
        /// call.
        #[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
        #[test]
        fn the_loop_makes_no_system_call() {
            $crate::realtime::assert_no_system_call::<$model>();
        }
    };
}

/// The instance in a control loop, with the arguments of its calls.
struct Loop<F: Either> {
    fmu: F,
    state: *mut c_void,
    time: f64,
    inputs: Vec<u32>,
    outputs: Vec<u32>,
    /// Values to set and values read.
    values: [Vec<f64>; 2],
    parameter: (u32, f64),
    booleans: Vec<u32>,
}

impl<F: Either> Loop<F> {
    fn new<M: Exported>() -> Self {
        let (fmu, inputs, outputs) = (F::initialized_at::<M>(0.0), inputs::<M>(), outputs::<M>());
        let parameter = (0..).zip(M::TABLE).find_map(|(index, of)| Some((index, start_of(of)?)));
        Self {
            state: fmu.save(),
            fmu,
            time: 0.0,
            values: [vec![0.0; inputs.len()], vec![0.0; outputs.len()]],
            inputs,
            outputs,
            parameter: parameter.expect("a parameter"),
            booleans: boolean_parameters::<M>(),
        }
    }

    /// Performs one step of size `h`, and saves the state over an earlier one.
    fn turn(&mut self, h: f64) {
        let Self { fmu, state, time, values: [set, read], inputs, outputs, .. } = self;
        set.iter_mut().zip(1_u8..).for_each(|(value, i)| *value = (*time * f64::from(i)).sin());
        fmu.set(inputs, set);
        fmu.set_input_derivatives(inputs, set);
        fmu.step(*time, h);
        fmu.ok(fmu.try_get(outputs, read));
        fmu.ok(fmu.get_state(state));
        *time += h;
    }

    /// Makes calls that are rarer: sets a parameter and Booleans, restores a state, and reads derivatives.
    fn change(&self, factor: f64) {
        let Self { fmu, parameter: (parameter, start), .. } = self;
        fmu.set(&[*parameter], &[start * factor]);
        self.booleans.iter().for_each(|boolean| fmu.ok(fmu.set_boolean(*boolean, 1)));
        fmu.ok(fmu.set_state(self.state));
        self.outputs.iter().for_each(|output| _ = fmu.rate(*output));
        fmu.partial(self.outputs[0], self.inputs[0]);
    }

    /// Performs a thousand steps of one size, alternating with a thousand steps of increasing sizes, and the rarer calls
    /// in between. The largest step sizes reach code of the testbed that smaller ones do not.
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

/// Runs the loop with a model in both FMI versions.
///
/// # Panics
/// Panics if the loop allocates.
pub fn assert_no_allocation<M: Exported>() {
    let (mut old, mut new) = (Loop::<Importer>::new::<M>(), Loop::<fmi3::Importer>::new::<M>());
    assert_eq!([allocations(|| old.run()), allocations(|| new.run())], [0; 2]);
}

/// Runs the loop with a model in both FMI versions.
///
/// # Panics
/// Panics if the loop makes a system call, or if system calls are not detected.
#[cfg(all(target_os = "linux", any(target_arch = "x86_64", target_arch = "aarch64")))]
pub fn assert_no_system_call<M: Exported>() {
    assert_eq!(without_kernel(&mut || ()), Ended::Exited(0));
    let caught = without_kernel(&mut || drop(std::fs::metadata("/")));
    assert_eq!(caught, Ended::Killed(libc::SIGSYS), "a system call must be detected");
    let (mut old, mut new) = (Loop::<Importer>::new::<M>(), Loop::<fmi3::Importer>::new::<M>());
    assert_eq!(without_kernel(&mut || old.run()), Ended::Exited(0));
    assert_eq!(without_kernel(&mut || new.run()), Ended::Exited(0));
}

/// Searches all files below a directory for locks and other shared data; returns the number of files. Only the gate of an
/// instance may be atomic, because no call waits for it: an overlapping call is an error.
///
/// # Panics
/// Panics if it finds any.
pub fn assert_nothing_to_lock(directory: &Path) -> usize {
    let shared = ["Mutex", "RwLock", "Condvar", "Once", "OnceLock", "LazyLock", "thread_local"];
    let mut directories = vec![directory.to_owned()];
    let mut files = 0;
    while let Some(directory) = directories.pop() {
        for entry in std::fs::read_dir(&directory).expect("a readable directory") {
            let path = entry.expect("a readable directory").path();
            if path.is_dir() {
                directories.push(path);
                continue;
            }
            files += 1;
            let source = std::fs::read_to_string(&path).expect("a readable file");
            // Each instance has a separate WebAssembly module, so nothing in it is shared.
            if source.contains("#![cfg(target_family = \"wasm\")]") {
                continue;
            }
            for word in source.split(|c: char| !c.is_alphanumeric() && c != '_') {
                let found = shared.contains(&word)
                    || word.starts_with("Atomic") && !path.ends_with("boundary/gate.rs");
                assert!(!found, "{} has {word}", path.display());
            }
            assert!(!source.contains("static mut"), "{} has static mut", path.display());
        }
    }
    files
}

/// Marks code for the RealtimeSanitizer (`--cfg rtsan`), which then reports calls that may block.
pub mod sanitizer {
    /// Section in which blocking calls are forbidden; ends when dropped.
    #[derive(Debug)]
    #[must_use]
    pub struct Context;

    #[cfg(rtsan)]
    unsafe extern "C" {
        fn __rtsan_realtime_enter();
        fn __rtsan_realtime_exit();
    }

    /// Begins a section in which blocking calls are forbidden.
    pub fn enter() -> Context {
        // SAFETY: only marks the thread.
        #[cfg(rtsan)]
        unsafe {
            __rtsan_realtime_enter()
        }
        Context
    }

    impl Drop for Context {
        fn drop(&mut self) {
            // SAFETY: only marks the thread.
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
        /// The process exited with this code.
        Exited(i32),
        /// This signal ended the process; SIGSYS after a system call.
        Killed(i32),
    }

    /// Runs the work in a copy of this process in which every system call except exit is fatal.
    ///
    /// # Panics
    /// Panics if the process cannot be copied.
    pub fn without_kernel(work: &mut dyn FnMut()) -> Ended {
        // SAFETY: the child runs the work and exits. If the work allocates or locks, the child may wait for ever for a
        // lock that another thread held during the fork, but such work must fail the test anyway.
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
        // SAFETY: waits for the child; the pointer is a live reference.
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
            statement(BPF_LD | BPF_W | BPF_ABS, 0, 0, 0), // number of the system call
            statement(BPF_JMP | BPF_JEQ | BPF_K, libc::SYS_exit_group as u32, 0, 1),
            statement(BPF_RET | BPF_K, libc::SECCOMP_RET_ALLOW, 0, 0),
            statement(BPF_RET | BPF_K, libc::SECCOMP_RET_KILL_PROCESS, 0, 0),
        ];
        let program = sock_fprog { len: filter.len() as u16, filter: filter.as_mut_ptr() };
        // SAFETY: both calls only restrict this process; the kernel copies the filter program.
        unsafe {
            libc::prctl(libc::PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
                && libc::prctl(libc::PR_SET_SECCOMP, libc::SECCOMP_MODE_FILTER, &raw const program) == 0
        }
    }
}
