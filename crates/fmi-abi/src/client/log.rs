//! Log callbacks for FMUs, and the list of living instances.
//!
//! FMUs do not always pass the environment of the instance to the logger: some pass their own pointer, NULL, or the environment of
//! another instance, and some log from their own threads. So the environment is a number that is looked up, never a pointer that is
//! dereferenced.

use super::rejection::Message;
use crate::c_types::{c_char, c_int, c_void};
use crate::fmi2::types::*;
use crate::fmi3::types::*;
use crate::{BaseType, Status};
use std::collections::{BTreeMap, VecDeque};
use std::ffi::CStr;
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

/// Copies a C string; returns an empty string for a null pointer.
///
/// # Safety
/// `pointer` is null or points to a NUL-terminated string.
unsafe fn string(pointer: *const c_char) -> String {
    if pointer.is_null() {
        return String::new();
    }
    // SAFETY: the caller guarantees NULL or a NUL-terminated string.
    unsafe { CStr::from_ptr(pointer) }.to_string_lossy().into_owned()
}

/// Returns the callbacks of FMI 2.0 (section 2.1.5 of FMI 2.0.5). The returned value must live as long as the
/// instance. The memory functions call `calloc` and `free` of C. They must be present, because only an FMU with
/// `canNotUseMemoryManagementFunctions` ignores them.
pub fn callbacks(environment: *mut c_void) -> fmi2CallbackFunctions {
    let logger = log_of_fmi2 as *const ();
    fmi2CallbackFunctions {
        // SAFETY: the documentation of `log_of_fmi2` explains why both types have compatible calls.
        logger: Some(unsafe { std::mem::transmute::<*const (), fmi2CallbackLogger>(logger) }),
        allocate_memory: Some(allocate),
        free_memory: Some(free),
        step_finished: None,
        component_environment: environment,
    }
}

unsafe extern "C" fn allocate(count: usize, size: usize) -> *mut c_void {
    // SAFETY: any arguments are allowed; the FMU frees the memory with `free`.
    unsafe { libc::calloc(count, size) }
}

unsafe extern "C" fn free(memory: *mut c_void) {
    // SAFETY: section 2.1.5 of FMI 2.0 requires NULL, or memory of `allocate` that is freed once.
    unsafe { libc::free(memory) }
}

/// Logger of FMI 2.0. Stable Rust cannot define variadic functions, so this one has a fixed number of arguments: integers and
/// pointers, then floating-point numbers, which are passed in separate registers. On Linux, and on macOS with Intel processors,
/// variadic functions receive their arguments in these registers and then on the stack. If the caller passes fewer arguments, the
/// others have arbitrary values; reading them is harmless there, and a correct format does not use them.
#[cfg(any(all(unix, target_arch = "x86_64"), all(target_os = "linux", target_arch = "aarch64")))]
#[allow(clippy::too_many_arguments, reason = "the arguments of the format")]
unsafe extern "C" fn log_of_fmi2(
    environment: fmi2ComponentEnvironment,
    _instance_name: fmi2String,
    status: fmi2Status,
    category: fmi2String,
    message: fmi2String,
    a: usize,
    b: usize,
    c: usize,
    d: usize,
    e: usize,
    f: usize,
    g: usize,
    h: usize,
    r: f64,
    s: f64,
    t: f64,
    u: f64,
    v: f64,
    w: f64,
    x: f64,
    y: f64,
) {
    // SAFETY: section 2.1.5 of FMI 2.0 requires NULL or NUL-terminated strings.
    let [category, format] = [category, message].map(|text| unsafe { string(text) });
    let arguments = super::format::Arguments::new([a, b, c, d, e, f, g, h], [r, s, t, u, v, w, x, y]);
    let message = Message { status: Status::from_c(status), category, text: arguments.expand(&format) };
    store(environment.addr(), message, true);
}

/// Logger of FMI 2.0 for all other platforms. It does not expand formats, because it cannot read variadic arguments there. The
/// arguments before the `...` are passed in the same way as to a function without `...`.
#[cfg(not(any(all(unix, target_arch = "x86_64"), all(target_os = "linux", target_arch = "aarch64"))))]
unsafe extern "C" fn log_of_fmi2(
    environment: fmi2ComponentEnvironment,
    _instance_name: fmi2String,
    status: fmi2Status,
    category: fmi2String,
    message: fmi2String,
) {
    // SAFETY: section 2.1.5 of FMI 2.0 requires NULL or NUL-terminated strings.
    let [category, text] = [category, message].map(|text| unsafe { string(text) });
    store(environment.addr(), Message { status: Status::from_c(status), category, text }, true);
}

/// Logger of FMI 3.0 for instances of this crate.
///
/// # Safety
/// Category and message are NULL or NUL-terminated strings (section 2.3.1 of FMI 3.0).
pub unsafe extern "C" fn log_of_fmi3(
    environment: fmi3InstanceEnvironment,
    status: c_int,
    category: fmi3String,
    message: fmi3String,
) {
    // SAFETY: the caller guarantees NULL or NUL-terminated strings.
    let [category, text] = [category, message].map(|text| unsafe { string(text) });
    store(environment.addr(), Message { status: Status::from_c(status), category, text }, false);
}
