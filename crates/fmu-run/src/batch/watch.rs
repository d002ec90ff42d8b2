//! Lets the caller observe and cancel runs.

use crate::error::lock;
use crate::messages::{Feed, Logged};
use std::fmt;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

/// Function that is called about ten times per second.
type OnPulse = Box<dyn Fn(&Watch) + Send + Sync>;

/// Shows the progress of [`System::run`](crate::System::run) and can cancel it, from the calling thread or another one.
#[derive(Default)]
pub struct Watch {
    pulse: Option<OnPulse>,
    pub(super) done: AtomicUsize,
    cancelled: AtomicBool,
    /// Runs that the FMU has ended: index, end time in s, and outputs.
    pub(super) ended: Mutex<Vec<(usize, f64, Vec<f64>)>>,
    pub(super) listening: bool,
    /// Collects all messages during the runs.
    pub(super) feed: OnceLock<Arc<Feed>>,
}

impl fmt::Debug for Watch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Watch")
            .field("done", &self.done)
            .field("cancelled", &self.cancelled)
            .finish_non_exhaustive()
    }
}

impl Watch {
    /// Creates a watch with a function that is called about ten times per second by the thread that called
    /// [`System::run`](crate::System::run), between its steps or while it waits for other threads. The function may
    /// [cancel](Self::cancel) the runs.
    ///
    /// ```
    /// let watch = fmu_run::Watch::pulsing(|watch| eprintln!("{} runs are finished", watch.done()));
    /// # assert_eq!(watch.done(), 0);
    /// ```
    pub fn pulsing(pulse: impl Fn(&Self) + Send + Sync + 'static) -> Self {
        Self { pulse: Some(Box::new(pulse)), ..Self::default() }
    }

    /// Creates a watch that collects all messages of the FMU and switches logging on.
    pub fn listening() -> Self {
        Self { listening: true, ..Self::default() }
    }

    /// Returns a watch that also collects all messages of the FMU and switches logging on.
    #[must_use]
    pub fn and_listening(self) -> Self {
        Self { listening: true, ..self }
    }

    /// Returns the messages that were logged since the last call of this function.
    pub fn take_messages(&self) -> Vec<Logged> {
        self.feed.get().map(|feed| feed.take()).unwrap_or_default()
    }

    /// Returns the runs that the FMU has ended, sorted by their index. Each has its index, the end time in s, and the outputs at this
    /// time, which are NaN if they cannot be read.
    pub fn ended(&self) -> Vec<(usize, f64, Vec<f64>)> {
        let mut ended = lock(&self.ended).clone();
        ended.sort_unstable_by_key(|(run, ..)| *run);
        ended
    }

    /// Returns the number of finished runs, including failed ones.
    pub fn done(&self) -> usize {
        self.done.load(Ordering::Relaxed)
    }

    /// Cancels the runs: no further run begins, and current runs stop after the current step.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    pub(super) fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    pub(super) fn pulse(&self) {
        if let Some(pulse) = &self.pulse {
            pulse(self);
        }
    }
}
