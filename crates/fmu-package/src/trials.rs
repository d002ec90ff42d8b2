//! Watches a model while it is tried: its first panic, and calls that do not return.
#![allow(unsafe_code, reason = "the library reports panics to a C function")]

use anyhow::{Result, bail};
use fmi_abi::c_types::c_void;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};

/// The call in progress, and the first panic or fault of a model.
#[derive(Debug, Default)]
pub(crate) struct Trials {
    call: Mutex<Option<(&'static str, Instant)>>,
    panic: Mutex<Option<String>>,
}

/// How often the time of the call in progress is checked.
const INTERVAL: Duration = Duration::from_millis(200);

impl Trials {
    /// Begins a call, which has this name in messages. It ends when another one begins.
    pub fn begin(&self, call: &'static str) {
        *lock(&self.call) = Some((call, Instant::now()));
    }

    /// Ends the last call.
    pub fn end(&self) {
        *lock(&self.call) = None;
    }

    /// Ends this process with an error if a call takes longer than the limit, because nothing else can end a loop of the
    /// model.
    pub fn watch(self: &Arc<Self>, model: String, limit: Duration) {
        let watched = Arc::downgrade(self);
        std::thread::spawn(move || {
            while let Some(trials) = Weak::upgrade(&watched) {
                if let Some((call, since)) = *lock(&trials.call)
                    && since.elapsed() > limit
                {
                    eprintln!(
                        "error: {model}: {call} has not returned for {} s, so the model seems to be in an endless loop; if \
                         it is only slow, allow more with --time-limit SECONDS",
                        limit.as_secs()
                    );
                    std::process::exit(1);
                }
                drop(trials);
                std::thread::sleep(INTERVAL);
            }
        });
    }

    /// Returns the first panic or fault as an error.
    pub fn check(&self) -> Result<()> {
        match &*lock(&self.panic) {
            Some(panic) => bail!("{panic}"),
            None => Ok(()),
        }
    }

    /// Records a fault, unless there was one before.
    pub fn fail(&self, fault: String) {
        lock(&self.panic).get_or_insert(fault);
    }

    /// Receives the place and the message of a panic from the library.
    ///
    /// # Safety
    /// The context is a `Trials` that is never freed, and the text is UTF-8 of this length.
    pub unsafe extern "C" fn receive(context: *mut c_void, text: *const u8, length: usize) {
        // SAFETY: the caller guarantees it.
        let (trials, text) = unsafe { (&*context.cast::<Self>(), std::slice::from_raw_parts(text, length)) };
        let call = lock(&trials.call).map_or("a call", |(call, _)| call);
        let text = String::from_utf8_lossy(text);
        lock(&trials.panic).get_or_insert_with(|| format!("the model panics in {call}: {text}"));
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
