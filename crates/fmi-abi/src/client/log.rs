//! The messages of FMUs, and the list of living instances.
//!
//! FMUs do not always pass the environment of the instance to the logger: some pass their own pointer, NULL, or the environment of
//! another instance, and some log from their own threads. So the environment is a number that is looked up, never a pointer that is
//! dereferenced.

use super::format::Arguments;
use super::rejection::Message;
use crate::c_types::c_void;
use crate::calls::{LogMessage, LogReceiver, LogValues, string};
use crate::{BaseType, Standard, Status};
use std::collections::{BTreeMap, VecDeque};
use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread::ThreadId;

/// Receiver of log messages, called while the FMU logs, also from threads of the FMU. It must not call the FMU and must not panic.
pub trait LogListener: Send + Sync {
    /// Receives a message of the instance with this [`number`](super::Settings::listener); `None` if several instances are alive and
    /// the FMU names none of them.
    fn on_message(&self, number: Option<usize>, message: &Message);
}

/// Names of variables, for messages that refer to them.
pub trait VariableNames: Send + Sync {
    /// Returns the name of the variable of FMI 2.0 with this type and this value reference, if there is one. Integers stand for
    /// enumerations, too.
    fn name_of(&self, base: BaseType, reference: u32) -> Option<String>;
}

/// Replaces references to variables, such as `#r1#`, by their names, and `##` by `#` (section 2.1.5 of FMI 2.0). Any other `#` stays,
/// because many FMUs do not escape it.
fn with_names(text: &str, names: Option<&dyn VariableNames>) -> String {
    let (mut named, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(at) = rest.find('#') {
        named.push_str(&rest[..at]);
        rest = &rest[at + 1..];
        if let Some(after) = rest.strip_prefix('#') {
            named.push('#');
            rest = after;
        } else if let Some((name, after)) = reference(rest, names) {
            named.push_str(&name);
            rest = after;
        } else {
            named.push('#');
        }
    }
    named + rest
}

/// Reads a reference after its first `#`. Returns the name of the variable and the text after the reference.
fn reference<'t>(text: &'t str, names: Option<&dyn VariableNames>) -> Option<(String, &'t str)> {
    let (reference, after) = text.split_once('#')?;
    let base = match reference.chars().next()? {
        'r' => BaseType::Real,
        'i' => BaseType::Integer,
        'b' => BaseType::Boolean,
        's' => BaseType::String,
        _ => return None,
    };
    Some((names?.name_of(base, reference[1..].parse().ok()?)?, after))
}

/// Maximum number of stored messages, from which a later error takes its reason. Older ones are dropped.
const MOST_MESSAGES: usize = 64;

/// The log of an instance.
pub(crate) struct Log {
    /// Number that the FMU gets as the environment of the instance. It is unique in the process.
    environment: usize,
    /// Messages since the last call of [`take`](Self::take), which follows each FMI call that does not return OK.
    new: Mutex<VecDeque<Message>>,
    listener: Option<(Arc<dyn LogListener>, usize)>,
    names: Option<Arc<dyn VariableNames>>,
}

impl fmt::Debug for Log {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Log").field("new", &self.new).finish_non_exhaustive()
    }
}

/// Logs of the living instances, by environment.
static LIVING: RwLock<BTreeMap<usize, Arc<Log>>> = RwLock::new(BTreeMap::new());

/// Messages with an unknown environment, each with the thread that logged it. Most FMUs log during a call and on its thread, so the next
/// failed call on this thread takes the message.
static STRAY: Mutex<VecDeque<(ThreadId, Message)>> = Mutex::new(VecDeque::new());

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Log {
    /// Creates a log and registers it in the list of living instances.
    pub fn register(
        listener: Option<(Arc<dyn LogListener>, usize)>,
        names: Option<Arc<dyn VariableNames>>,
    ) -> Arc<Self> {
        /// Distance between two environments. They are aligned like the pointers of `malloc`, in case an FMU checks that.
        const SPACING: usize = 16;
        static NEXT: AtomicUsize = AtomicUsize::new(0x1000);
        let environment = NEXT.fetch_add(SPACING, Ordering::Relaxed);
        let log = Arc::new(Self { environment, new: Mutex::default(), listener, names });
        LIVING.write().unwrap_or_else(PoisonError::into_inner).insert(environment, Arc::clone(&log));
        log
    }

    /// Removes the log from the list; called when its instance is freed.
    pub fn unregister(&self) {
        LIVING.write().unwrap_or_else(PoisonError::into_inner).remove(&self.environment);
    }

    pub fn environment(&self) -> *mut c_void {
        std::ptr::without_provenance_mut(self.environment)
    }

    /// Returns the messages since the last call of this function. Messages with an unknown environment are included if this thread
    /// logged them, because the FMI call that this thread has just made is their likely cause.
    pub fn take(&self) -> Vec<Message> {
        let mut messages = Vec::from(std::mem::take(&mut *lock(&self.new)));
        let mut stray = lock(&STRAY);
        if !stray.is_empty() {
            let this = std::thread::current().id();
            messages.extend(
                stray.iter().filter(|(thread, _)| *thread == this).map(|(_, message)| message.clone()),
            );
            stray.retain(|(thread, _)| *thread != this);
        }
        messages
    }

    fn add(&self, message: Message) {
        if let Some((listener, number)) = &self.listener {
            listener.on_message(Some(*number), &message);
        }
        push_limited(&mut lock(&self.new), message);
    }
}

/// Adds an item. If there are already `MOST_MESSAGES`, removes the oldest one first.
fn push_limited<T>(items: &mut VecDeque<T>, item: T) {
    if items.len() >= MOST_MESSAGES {
        items.pop_front();
    }
    items.push_back(item);
}

/// Stores a message in the log of the instance that has this environment. If the environment is unknown but only one instance is alive,
/// the message must be from that instance. In FMI 2.0 (`has_references`), the message may refer to variables.
fn store(environment: usize, mut message: Message, has_references: bool) {
    let living = LIVING.read().unwrap_or_else(PoisonError::into_inner);
    let only = || living.values().next().filter(|_| living.len() == 1);
    if let Some(log) = living.get(&environment).or_else(only) {
        let log = Arc::clone(log);
        drop(living);
        if has_references {
            message.text = with_names(&message.text, log.names.as_deref());
        }
        return log.add(message);
    }
    if has_references {
        message.text = with_names(&message.text, None);
    }
    let mut listeners: Vec<Arc<dyn LogListener>> = Vec::new();
    for (listener, _) in living.values().filter_map(|log| log.listener.as_ref()) {
        if !listeners.iter().any(|other| Arc::ptr_eq(other, listener)) {
            listeners.push(Arc::clone(listener));
        }
    }
    drop(living);
    listeners.iter().for_each(|listener| listener.on_message(None, &message));
    push_limited(&mut lock(&STRAY), (std::thread::current().id(), message));
}

impl LogReceiver for Log {
    unsafe fn receive(message: LogMessage) {
        // SAFETY: the caller guarantees NULL or NUL-terminated strings.
        let owned = |pointer| unsafe { string(pointer) }.unwrap_or_default().to_string_lossy().into_owned();
        let (status, category) = (Status::from_c(message.status), owned(message.category));
        let mut text = owned(message.text);
        if let Some(LogValues { words, numbers }) = message.values {
            text = Arguments::new(words, numbers).expand(&text);
        }
        let has_references = message.standard == Standard::Fmi2;
        store(message.environment.addr(), Message { status, category, text }, has_references);
    }
}
