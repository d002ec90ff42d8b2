//! Threads that wait for work between calls.

use crate::error::Error;
use std::sync::Once;
use std::sync::atomic::{AtomicU32, Ordering};

/// Number of forks from the first process with this library to this process.
static FORKS: AtomicU32 = AtomicU32::new(0);

/// Identifies this process: the number is another one in a process that was forked from it.
pub fn process() -> u32 {
    static COUNTING: Once = Once::new();
    COUNTING.call_once(count_forks);
    FORKS.load(Ordering::Relaxed)
}

#[cfg(unix)]
fn count_forks() {
    extern "C" fn forked() {
        FORKS.fetch_add(1, Ordering::Relaxed);
    }
    // SAFETY: the function is called in a forked process; it only changes an atomic number, so that it is
    // async-signal-safe.
    unsafe {
        libc::pthread_atfork(None, None, Some(forked));
    }
}

#[cfg(not(unix))]
fn count_forks() {}

/// A pool of threads of this process. A forked process has the object but not its threads, so that work for
/// them would never end.
#[derive(Debug)]
pub(crate) struct Threads {
    process: u32,
    /// `None` only while dropping.
    pool: Option<rayon::ThreadPool>,
}

impl Threads {
    pub fn new(count: usize) -> Result<Self, Error> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
        let pool = pool.map_err(|error| Error::Fmu(format!("no threads can be made: {error}")))?;
        Ok(Self { process: process(), pool: Some(pool) })
    }

    /// Returns whether the threads belong to this process.
    pub fn are_here(&self) -> bool {
        self.process == process()
    }

    pub fn count(&self) -> usize {
        self.pool().current_num_threads()
    }

    pub fn pool(&self) -> &rayon::ThreadPool {
        self.pool.as_ref().expect("the pool exists until it is dropped")
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        // After a fork, its locks may be held by threads that do not exist.
        if !self.are_here() {
            std::mem::forget(self.pool.take());
        }
    }
}
