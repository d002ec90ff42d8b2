//! Whether code may run in a control loop: it must not allocate, not enter the kernel, not lock.
//!
//! * Allocations are counted by an allocator that the test installs: `#[global_allocator] static COUNTING: Counting =
//!   Counting;`, see [`allocations`].
//! * System calls end a copy of the process in which the work is done, see [`without_kernel`].
//! * Locks are words that the source must not have, see [`assert_nothing_to_lock`]: a lock that is free is an atomic
//!   instruction, which no run shows, nor any sanitizer.
//! * Built with `--cfg rtsan` and the RealtimeSanitizer, [`sanitizer`] marks where nothing may be called that can block.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::path::Path;

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
