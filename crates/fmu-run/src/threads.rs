//! Threads that are kept between calls.

use crate::error::Error;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::sync::{Arc, Once};
use std::time::{Duration, Instant};

/// Number of forks between the process that first called [`process`] and this process.
static FORKS: AtomicU32 = AtomicU32::new(0);

/// Returns a number that differs between a process and the processes that it forks. It is always 0 where processes cannot fork.
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
    // SAFETY: the function is called in the forked process. It only changes an atomic number, so it is async-signal-safe.
    unsafe {
        libc::pthread_atfork(None, None, Some(forked));
    }
}

#[cfg(not(unix))]
fn count_forks() {}

/// A pool of threads. A forked process inherits the object but not the threads, so work for the pool would never be done there.
#[derive(Debug)]
pub(crate) struct Threads {
    process: u32,
    /// Number of threads that poll for work.
    awake: Arc<AtomicUsize>,
    /// `None` only while dropping.
    pool: Option<rayon::ThreadPool>,
}

impl Threads {
    pub fn new(count: usize) -> Result<Self, Error> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build();
        let pool = pool.map_err(|error| Error::Fmu(format!("no threads can be made: {error}")))?;
        Ok(Self { process: process(), awake: Arc::default(), pool: Some(pool) })
    }

    /// Returns whether the threads belong to this process.
    pub fn are_here(&self) -> bool {
        self.process == process()
    }

    pub fn count(&self) -> usize {
        self.pool().current_num_threads()
    }

    /// Time for which threads poll for work before they sleep, because waking a sleeping thread takes long compared with a short
    /// step.
    const AWAKE: Duration = Duration::from_micros(50);

    /// Calls `own` in this thread and the other functions in the threads of the pool. Returns when all calls have returned.
    pub fn share<'s>(&'s self, own: impl FnOnce(), others: impl Iterator<Item = impl FnOnce() + Send + 's>) {
        let running = AtomicUsize::new(0);
        self.pool().in_place_scope(|scope| {
            for other in others {
                running.fetch_add(1, Ordering::Relaxed);
                let running = &running;
                scope.spawn(move |_| {
                    other();
                    running.fetch_sub(1, Ordering::Release);
                });
            }
            self.stay_awake();
            own();
            // Polls for a short time. Without this, the thread would sleep at the end of the scope while another thread still
            // works.
            let begin = Instant::now();
            while running.load(Ordering::Acquire) > 0 && begin.elapsed() < Self::AWAKE {
                std::thread::yield_now();
            }
        });
    }

    /// Makes the threads poll for the work of a call that may follow soon.
    fn stay_awake(&self) {
        if self.awake.load(Ordering::Relaxed) > 0 {
            return;
        }
        self.awake.store(self.count(), Ordering::Relaxed);
        let awake = Arc::clone(&self.awake);
        self.pool().spawn_broadcast(move |_| {
            let mut last = Instant::now();
            while last.elapsed() < Self::AWAKE {
                match rayon::yield_now() {
                    Some(rayon::Yield::Executed) => last = Instant::now(),
                    _ => std::thread::yield_now(),
                }
            }
            awake.fetch_sub(1, Ordering::Relaxed);
        });
    }

    pub fn pool(&self) -> &rayon::ThreadPool {
        self.pool.as_ref().expect("the pool exists until it is dropped")
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        // After a fork, the pool is leaked: its locks may be held by threads that do not exist in this process.
        if !self.are_here() {
            std::mem::forget(self.pool.take());
        }
    }
}
