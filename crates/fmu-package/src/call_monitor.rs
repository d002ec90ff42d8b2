//! Monitors the calls of a model while it is evaluated: records its first panic or fault, reports the progress if it takes long, and ends
//! the process if a call does not return.
#![allow(unsafe_code, reason = "the library reports panics to a C function")]

use anyhow::{Result, bail};
use fmi_abi::c_types::c_void;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

/// The call in progress, and the first panic or fault of a model.
#[derive(Debug, Default)]
pub(crate) struct CallMonitor {
    call: Mutex<Option<(&'static str, Instant)>>,
    /// The present activity, the number of its parts that are done, and the number of all its parts.
    activity: Mutex<Option<(&'static str, usize, usize)>>,
    fault: Mutex<Option<String>>,
}

/// Interval at which the duration of the call in progress is checked.
const INTERVAL: Duration = Duration::from_millis(200);
/// Time without a report of the progress.
const SILENCE: Duration = Duration::from_secs(5);

impl CallMonitor {
    /// Records that a call begins, and its name for messages. The call before it then counts as ended.
    pub fn begin(&self, call: &'static str) {
        *lock(&self.call) = Some((call, Instant::now()));
    }

    /// Records that the last call and the last activity have ended.
    pub fn end(&self) {
        *lock(&self.call) = None;
        *lock(&self.activity) = None;
    }

    /// Records how far an activity is, which is reported if it takes long.
    pub fn progress(&self, activity: &'static str, done: usize, all: usize) {
        *lock(&self.activity) = Some((activity, done, all));
    }

    /// Ends this process with an error if a call takes longer than the limit, because nothing else can end an endless loop in the
    /// model.
    pub fn watch(self: &Arc<Self>, model: String, limit: Duration) {
        let watched = Arc::downgrade(self);
        let mut reported = Instant::now();
        std::thread::spawn(move || {
            while let Some(monitor) = Weak::upgrade(&watched) {
                if let Some((call, since)) = *lock(&monitor.call)
                    && since.elapsed() > limit
                {
                    eprintln!(
                        "error: {model}: {call} has not returned for {} s, so the model seems to be in an endless loop; if \
                         it is only slow, allow more with --time-limit SECONDS",
                        limit.as_secs()
                    );
                    std::process::exit(1);
                }
                if let Some((activity, done, all)) = *lock(&monitor.activity)
                    && reported.elapsed() > SILENCE
                {
                    eprintln!("note: {model}: the build {activity}: {done} of {all}");
                    reported = Instant::now();
                }
                drop(monitor);
                std::thread::sleep(INTERVAL);
            }
        });
    }

    /// Returns the first panic or fault as an error.
    pub fn check(&self) -> Result<()> {
        match &*lock(&self.fault) {
            Some(fault) => bail!("{fault}"),
            None => Ok(()),
        }
    }

    /// Receives the source location and the message of a panic from the library.
    ///
    /// # Safety
    /// The context is a `CallMonitor` that is never freed, and the text is UTF-8 of this length.
    pub unsafe extern "C" fn receive(context: *mut c_void, text: *const u8, length: usize) {
        // SAFETY: the caller guarantees it.
        let (monitor, text) = unsafe { (&*context.cast::<Self>(), std::slice::from_raw_parts(text, length)) };
        let call = lock(&monitor.call).map_or("a call", |(call, _)| call);
        let text = String::from_utf8_lossy(text);
        lock(&monitor.fault).get_or_insert_with(|| format!("the model panics in {call}: {text}"));
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
