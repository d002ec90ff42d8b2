//! Monitors the calls of a model while it is evaluated: records its first panic or fault, and ends the process if a call does not return.
#![allow(unsafe_code, reason = "the library reports panics to a C function")]

use anyhow::{Result, bail};
use fmi_abi::c_types::c_void;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

/// The call in progress, and the first panic or fault of a model.
#[derive(Debug, Default)]
pub(crate) struct CallMonitor {
    call: Mutex<Option<(&'static str, Instant)>>,
    fault: Mutex<Option<String>>,
}

/// Interval at which the duration of the call in progress is checked.
const INTERVAL: Duration = Duration::from_millis(200);

impl CallMonitor {
    /// Records that a call begins, and its name for messages. The call before it then counts as ended.
    pub fn begin(&self, call: &'static str) {
        *lock(&self.call) = Some((call, Instant::now()));
    }

    /// Records that the last call has ended.
    pub fn end(&self) {
        *lock(&self.call) = None;
    }

    /// Ends this process with an error if a call takes longer than the limit, because nothing else can end an endless loop in the
    /// model.
    pub fn watch(self: &Arc<Self>, model: String, limit: Duration) {
        let watched = Arc::downgrade(self);
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

    /// Records a fault, unless there was one before.
    pub fn fail(&self, fault: String) {
        lock(&self.fault).get_or_insert(fault);
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
