//! Process that loads the library and executes a call sequence. The FMU may crash the process, so each result is written to a file
//! before the next call.

mod contain;
mod integrate;
mod measure;
mod memory;
#[cfg(target_os = "linux")]
mod server;
mod settings;
mod updates;

use crate::call_sequence::{
    Arg, CallSequence, Kind, Make, Message, NULL_INSTANCE, Numbered, Outcome, Setting, Step, Values,
};
#[cfg(not(target_os = "linux"))]
pub use contain::end_group;
#[cfg(target_os = "linux")]
pub use contain::readable;
pub use contain::{interrupted, listen_for_interrupts};
use fmi_abi::Standard;
use fmi_abi::c_types::{c_char, c_int, c_void};
use fmi_abi::calls;
use fmi_abi::fmi2::types::{fmi2CallbackFunctions, fmi2CallbackLogger};
use fmi_abi::fmi3::types::fmi3LogMessageCallback;
use fmi_abi::{fmi2, fmi3};
pub use memory::FILL;
use memory::{Guarded, in_fmu};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::ffi::{CStr, CString};
use std::fs::File;
use std::io::Write as _;
use std::path::Path;
use std::process::ExitStatus;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Instant;
pub use updates::MOST_UPDATES;

/// Environment variable with the path of the job of a worker; empty for a server.
pub const VARIABLE: &str = "FMU_CHECK_JOB";

/// Environment variable with the path of the temporary directory of a check.
pub const SCRATCH: &str = "FMU_CHECK_SCRATCH";

/// Exit status of a worker that fails for a reason other than the FMU.
pub const OWN_FAULT: i32 = 97;

/// Exit status of a worker that has executed its call sequence.
pub const EXECUTED: i32 = 96;

/// Number of repetitions from which on their measurements are evaluated.
pub const EVALUATED: usize = 50;

#[derive(Serialize, Deserialize)]
pub struct Job {
    /// Parameters that all call sequences share.
    pub setting: Setting,
    pub sequence: CallSequence,
    /// Serialized states of earlier processes of the call sequence, by index.
    pub bytes: HashMap<usize, Vec<u8>>,
}

/// Program that is run in place of a call sequence, with the directory of the FMU as its argument.
#[derive(Serialize, Deserialize)]
pub struct Program {
    pub program: std::path::PathBuf,
    pub fmu: std::path::PathBuf,
    /// Maximum address space of its processes in bytes.
    pub memory: u64,
}

/// Results of a process. A process that exceeded the limit has neither an exit status nor a signal.
#[derive(Default, Serialize, Deserialize)]
pub struct Ended {
    /// Exit status.
    pub code: Option<i32>,
    /// Signal that ended the process.
    pub signal: Option<i32>,
    /// Standard output and standard error.
    pub output: String,
    /// Outcomes of the steps, a line of JSON for each.
    pub outcomes: String,
    /// Names of the child processes that were alive after its end.
    pub orphans: Vec<String>,
    /// Number of processes, if it exceeded the maximum.
    pub flood: Option<usize>,
    /// Whether the process ended in code of the FMU.
    pub inside: bool,
}

impl From<ExitStatus> for Ended {
    fn from(status: ExitStatus) -> Self {
        #[cfg(unix)]
        let signal = std::os::unix::process::ExitStatusExt::signal(&status);
        #[cfg(not(unix))]
        let signal = None;
        Self { code: status.code(), signal, ..Self::default() }
    }
}

/// Last line that a worker writes.
#[derive(Serialize, Deserialize)]
pub struct Last {
    pub bytes: HashMap<usize, Vec<u8>>,
}

/// Executes call sequences and ends the process if it was started as a worker. A program that offers checks must call this function
/// first in `main`.
pub fn run_worker_if_requested() {
    let Some(job) = std::env::var_os(VARIABLE) else { return };
    #[cfg(target_os = "linux")]
    if job.is_empty() {
        end(server::serve());
    }
    end(work_from_files(Path::new(&job)))
}

/// Executes the job in a file, and writes the outcomes to a file next to it.
fn work_from_files(job: &Path) -> Result<(), String> {
    let message = |error: std::io::Error| error.to_string();
    let read = std::fs::read(job).map_err(message)?;
    let outcomes = File::create(job.with_file_name("outcomes")).map_err(message)?;
    work(serde_json::from_slice(&read).map_err(|error| error.to_string())?, outcomes);
    Ok(())
}

/// Writes the buffered output, and ends the process without the exit handlers of the library, which are tested by `Step::Quit`.
fn end(result: Result<(), String>) -> ! {
    let status = match result {
        Ok(()) => EXECUTED,
        Err(error) => {
            eprintln!("{error}");
            OWN_FAULT
        }
    };
    #[cfg(unix)]
    // SAFETY: writes the buffers of the C library, and ends the process.
    unsafe {
        libc::fflush(std::ptr::null_mut());
        libc::_exit(status)
    }
    #[cfg(not(unix))]
    std::process::exit(status)
}

/// Executes a call sequence, and writes a line to the file for the outcome of each step.
fn work(job: Job, file: File) {
    limit(job.setting.memory);
    PROCESS.store(std::process::id(), Ordering::Relaxed);
    if job.setting.soft {
        memory::AFTER.store(4096, std::sync::atomic::Ordering::Relaxed);
    }
    let setting = match job.sequence.first().map(|numbered| &numbered.step) {
        Some(Step::Elsewhere(name)) => elsewhere(&job.setting, name),
        _ => job.setting,
    };
    let executor = Executor {
        setting,
        libraries: Mutex::default(),
        instances: Mutex::default(),
        states: Mutex::default(),
        bytes: Mutex::new(job.bytes),
        sizes: Mutex::default(),
        file: Mutex::new(file),
    };
    executor.execute(&job.sequence, true);
    executor.write(&Last { bytes: std::mem::take(&mut locked(&executor.bytes)) });
}

/// Returns the setting with the FMU in a directory of this name, which is a link in the working directory.
fn elsewhere(setting: &Setting, name: &str) -> Setting {
    let directory = setting.resources.parent().unwrap_or(&setting.resources);
    let there = std::env::current_dir().unwrap_or_default().join(name);
    #[cfg(unix)]
    if let Err(error) = std::os::unix::fs::symlink(directory, &there) {
        eprintln!("{}: {error}", there.display());
        std::process::exit(OWN_FAULT);
    }
    let moved = |path: &Path| there.join(path.strip_prefix(directory).unwrap_or(path));
    Setting {
        libraries: setting.libraries.clone().map(|library| library.map(|library| moved(&library))),
        resources: moved(&setting.resources),
        ..setting.clone()
    }
}

fn limit(memory: u64) {
    #[cfg(unix)]
    {
        let set = |what, value| {
            let limit = libc::rlimit { rlim_cur: value, rlim_max: value };
            // SAFETY: sets a limit of this process.
            unsafe { libc::setrlimit(what, &limit) };
        };
        set(libc::RLIMIT_CORE, 0);
        set(libc::RLIMIT_FSIZE, 1 << 30);
        #[cfg(target_os = "linux")]
        {
            set(libc::RLIMIT_AS, memory as _);
            // SAFETY: this process is killed when its parent process ends.
            unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) };
        }
    }
    let _ = memory;
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Messages, each with the environment pointer that the FMU passed to the logger.
static MESSAGES: Mutex<Vec<(usize, Message)>> = Mutex::new(Vec::new());

/// Whether several threads are running.
static THREADS: AtomicBool = AtomicBool::new(false);

/// Identifier of the process that executes the call sequence.
static PROCESS: AtomicU32 = AtomicU32::new(0);

/// Instance: its handle and the environment pointer that it received.
struct Instance {
    handle: usize,
    environment: usize,
    co_simulation: bool,
    /// Time of the next time event; infinite if there is none.
    next_event: f64,
    /// Callbacks of FMI 2.0, which must outlive the instance.
    _callbacks: Option<Box<fmi2CallbackFunctions>>,
}

/// Environment pointer of the first instance, and the difference to the pointer of the next one.
const FIRST_ENVIRONMENT: usize = 0x10_0000;
const ENVIRONMENT_STEP: usize = 16;

/// Environment pointer of the next instance.
static ENVIRONMENTS: AtomicUsize = AtomicUsize::new(FIRST_ENVIRONMENT);

// SAFETY: the callbacks are only read.
unsafe impl Send for Instance {}

struct Executor {
    setting: Setting,
    /// Loaded libraries of Co-Simulation and Model Exchange.
    libraries: Mutex<[Option<&'static libloading::Library>; 2]>,
    instances: Mutex<HashMap<usize, Instance>>,
    states: Mutex<HashMap<usize, usize>>,
    bytes: Mutex<HashMap<usize, Vec<u8>>>,
    sizes: Mutex<HashMap<usize, usize>>,
    file: Mutex<File>,
}

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

/// # Safety
/// Each string is NULL or ends with NUL.
unsafe fn remember(environment: *mut c_void, status: c_int, category: *const c_char, text: *const c_char) {
    // SAFETY: the caller's requirement.
    let [category, text] = [category, text].map(|pointer| unsafe { text_at(pointer) });
    let mut messages = locked(&MESSAGES);
    if messages.len() < 1000 {
        messages.push((environment as usize, Message { status, category, text }));
    }
}

/// Logger of FMI 2.0. Stable Rust cannot define variadic functions, so it has named arguments: integers and pointers, then
/// floating-point numbers, which have separate registers. On Linux, and on macOS with Intel processors, variadic functions
/// receive their arguments in these registers, too.
#[allow(clippy::too_many_arguments, reason = "the values of the message")]
unsafe extern "C" fn log_of_fmi2(
    environment: *mut c_void,
    instance_name: *const c_char,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
    a: usize,
    b: usize,
    c: usize,
    d: usize,
    e: usize,
    f: usize,
    x: f64,
    y: f64,
    z: f64,
    w: f64,
) {
    // SAFETY: section 2.1.5 of FMI 2.0: the strings end with NUL, and `text` is a format of printf for the values. The name is
    // read because importers print it.
    unsafe {
        std::hint::black_box(text_at(instance_name));
        #[cfg(all(unix, not(all(target_vendor = "apple", target_arch = "aarch64"))))]
        if !text.is_null() {
            let print = |to: *mut c_char, size| libc::snprintf(to, size, text, a, b, c, d, e, f, x, y, z, w);
            let mut message = vec![0; usize::try_from(print(std::ptr::null_mut(), 0)).unwrap_or(0) + 1];
            print(message.as_mut_ptr(), message.len());
            return remember(environment, status, category, message.as_ptr());
        }
        #[cfg(not(all(unix, not(all(target_vendor = "apple", target_arch = "aarch64")))))]
        std::hint::black_box((a, b, c, d, e, f, x, y, z, w));
        remember(environment, status, category, text);
    }
}

unsafe extern "C" fn log_of_fmi3(
    environment: *mut c_void,
    status: c_int,
    category: *const c_char,
    text: *const c_char,
) {
    // SAFETY: section 2.3.1 of FMI 3.0: the strings end with NUL.
    unsafe { remember(environment, status, category, text) }
}

/// Array of a call, which is freed after the call.
struct Kept {
    array: Guarded,
    content: Content,
}

/// Content of an array: input for the FMU, values, or the handle, size or bytes of the saved state at an index.
enum Content {
    Input,
    Output(Kind, usize),
    State(usize),
    Size(usize),
    Saved(usize),
}

impl Executor {
    fn write(&self, line: &impl Serialize) {
        #[cfg(unix)]
        if std::process::id() != PROCESS.load(Ordering::Relaxed) {
            // The FMU has forked this process. The child process waits until the server ends it.
            loop {
                // SAFETY: waits.
                unsafe { libc::pause() };
            }
        }
        let mut line = serde_json::to_vec(line).unwrap_or_default();
        line.push(b'\n');
        // If the disk is full, the results are lost, and the checker reports an end of the process.
        let _ = locked(&self.file).write_all(&line);
    }

    fn execute(&self, sequence: &[Numbered], report: bool) -> Vec<Outcome> {
        let mut outcomes = Vec::new();
        for numbered in sequence {
            let mut outcome = Outcome { id: numbered.id, ..Outcome::default() };
            match &numbered.step {
                Step::Repeat(times, steps) => {
                    let begin = Instant::now();
                    memory::KEEP.store(true, Ordering::Relaxed);
                    let (mut done, mut last) = (0, Vec::new());
                    // The first repetitions may take longer: fewer are not evaluated, and the machine may be busy.
                    let patience = |done: usize| if done < EVALUATED { 4.0 } else { 1.0 };
                    let seconds = || begin.elapsed().as_secs_f64();
                    while done < *times && seconds() < patience(done) * self.setting.repetitions {
                        last = self.execute(steps, false);
                        done += 1;
                        if last.iter().any(|outcome| outcome.status.is_some_and(|status| status > 2)) {
                            break;
                        }
                    }
                    memory::KEEP.store(false, Ordering::Relaxed);
                    outcome.measured =
                        Some(crate::call_sequence::Measured { times: done, ..Default::default() });
                    if report {
                        last.iter().for_each(|outcome| self.write(outcome));
                    }
                }
                Step::Parallel(sequences) => {
                    memory::KEEP.store(true, Ordering::Relaxed);
                    THREADS.store(true, Ordering::Relaxed);
                    std::thread::scope(|scope| {
                        for sequence in sequences {
                            scope.spawn(|| self.execute(sequence, report));
                        }
                    });
                    THREADS.store(false, Ordering::Relaxed);
                    memory::KEEP.store(false, Ordering::Relaxed);
                }
                step => self.one(step, &mut outcome),
            }
            if report {
                self.write(&outcome);
            } else {
                outcomes.push(outcome);
            }
        }
        outcomes
    }

    fn one(&self, step: &Step, outcome: &mut Outcome) {
        match step {
            Step::Make(index, make) => self.make(*index, make, outcome),
            Step::Free(index) => {
                let null = (*index == NULL_INSTANCE).then_some(Instance {
                    handle: 0,
                    environment: 0,
                    co_simulation: self.setting.libraries[0].is_some(),
                    next_event: f64::INFINITY,
                    _callbacks: None,
                });
                let Some(instance) = null.or_else(|| locked(&self.instances).remove(index)) else { return };
                let name = self.named("FreeInstance");
                let address = self.find(instance.co_simulation, &name);
                outcome.missing = address.is_none();
                outcome.status = address.map(|address| {
                    // SAFETY: the functions of both FMI versions have this type.
                    in_fmu(|| unsafe {
                        let function: unsafe extern "C" fn(*mut c_void) = std::mem::transmute(address);
                        function(instance.handle as *mut c_void);
                    });
                    0
                });
                (outcome.log, outcome.strays) = messages(instance.environment);
            }
            Step::Version(name) => {
                let address = self.find(self.setting.libraries[0].is_some(), name);
                outcome.missing = address.is_none();
                // SAFETY: these functions have no arguments and return a string.
                outcome.text = address.and_then(|address| unsafe {
                    let function: unsafe extern "C" fn() -> *const c_char = std::mem::transmute(address);
                    text_at(in_fmu(|| function()))
                });
            }
            Step::Call { instance, function, args } => self.call(*instance, function, args, outcome),
            Step::Integrate(instance, how) => {
                memory::KEEP.store(true, Ordering::Relaxed);
                integrate::integrate(self, *instance, how, outcome);
                memory::KEEP.store(false, Ordering::Relaxed);
            }
            Step::Measure => outcome.measured = Some(measure::now()),
            Step::Unload => {
                let mut loaded: Vec<_> =
                    locked(&self.libraries).iter_mut().filter_map(Option::take).collect();
                loaded.dedup_by_key(|library| std::ptr::from_ref(*library));
                for library in loaded {
                    // SAFETY: made by Box::leak, and nothing else refers to it.
                    in_fmu(|| drop(unsafe { Box::from_raw(std::ptr::from_ref(library).cast_mut()) }));
                }
                // The standard output must not use memory of the library.
                #[cfg(unix)]
                // SAFETY: writes an empty line, and the buffers of the C library.
                in_fmu(|| unsafe {
                    libc::puts(c"".as_ptr());
                    libc::fflush(std::ptr::null_mut());
                });
            }
            Step::Quit => {
                self.write(&Last { bytes: HashMap::new() });
                in_fmu(|| std::process::exit(EXECUTED))
            }
            Step::Repeat(..) | Step::Parallel(_) | Step::FreshProcess | Step::Elsewhere(_) => {}
        }
    }

    fn named(&self, end: &str) -> String {
        format!("{}{end}", if self.setting.fmi3 { "fmi3" } else { "fmi2" })
    }

    fn find(&self, co_simulation: bool, name: &str) -> Option<*const c_void> {
        let index = usize::from(!co_simulation);
        let mut libraries = locked(&self.libraries);
        if libraries[index].is_none() {
            let path = self.setting.libraries[index].as_ref()?;
            if index == 1 && self.setting.libraries[0].as_ref() == Some(path) && libraries[0].is_some() {
                libraries[1] = libraries[0];
            } else {
                // SAFETY: loading the library may run any code of the FMU, in a process that may crash.
                let loaded = in_fmu(|| unsafe { libloading::Library::new(path) });
                match loaded {
                    Ok(library) => libraries[index] = Some(Box::leak(Box::new(library))),
                    Err(error) => {
                        let why = std::error::Error::source(&error)
                            .map_or_else(|| error.to_string(), |source| source.to_string());
                        self.write(&Unloadable { unloadable: why });
                        std::process::exit(EXECUTED)
                    }
                }
            }
        }
        // SAFETY: the symbol is only used as an address.
        let found = unsafe { libraries[index]?.get::<*const c_void>(name.as_bytes()) };
        found.ok().map(|symbol| *symbol).filter(|address| !address.is_null())
    }

    fn make(&self, index: usize, make: &Make, outcome: &mut Outcome) {
        // Strings are unmapped after the call: an FMU must copy the strings that it uses later.
        let text = |text: &str| Guarded::new(&CString::new(text).unwrap_or_default().into_bytes_with_nul());
        let (name, token) = (text(&make.name), text(&make.token));
        let standard = if self.setting.fmi3 { Standard::Fmi3 } else { Standard::Fmi2 };
        let location = standard.resources(&self.setting.resources);
        let resources = Guarded::new(location.as_bytes_with_nul());
        let word = |text: &Guarded| text.address() as usize as *const c_char;
        // Each instance has a different environment pointer, which the FMU must not dereference.
        let environment = ENVIRONMENTS.fetch_add(ENVIRONMENT_STEP, Ordering::Relaxed) as *mut c_void;
        let mut callbacks = None;
        let logger = log_of_fmi2 as *const ();
        let log: fmi3LogMessageCallback = log_of_fmi3;
        let function = match (self.setting.fmi3, make.co_simulation) {
            (false, _) => "fmi2Instantiate",
            (true, true) => "fmi3InstantiateCoSimulation",
            (true, false) => "fmi3InstantiateModelExchange",
        };
        let Some(address) = self.find(make.co_simulation, function) else {
            outcome.missing = true;
            return;
        };
        let find = |name: &str| (name == function).then_some(address);
        let (instance_name, guid, location) = (word(&name), word(&token), word(&resources));
        let logging = u8::from(make.logging);
        // SAFETY: the function has the type of the standard, and the arguments are as the standard requires.
        let handle = in_fmu(|| unsafe {
            match (self.setting.fmi3, make.co_simulation) {
                (false, co_simulation) => {
                    let given = &**callbacks.insert(Box::new(fmi2CallbackFunctions {
                        logger: Some(std::mem::transmute::<*const (), fmi2CallbackLogger>(logger)),
                        allocate_memory: Some(calloc),
                        free_memory: Some(free),
                        step_finished: None,
                        component_environment: environment,
                    }));
                    let instantiate = fmi2::Functions::find(find).fmi2Instantiate;
                    let kind = co_simulation.into();
                    instantiate(instance_name, kind, guid, location, given, 0, logging.into())
                }
                (true, false) => {
                    let instantiate = fmi3::Functions::find(find).fmi3InstantiateModelExchange;
                    instantiate(instance_name, guid, location, 0, logging, environment, Some(log))
                }
                (true, true) => {
                    let instantiate = fmi3::Functions::find(find).fmi3InstantiateCoSimulation;
                    instantiate(
                        instance_name,
                        guid,
                        location,
                        0,
                        logging,
                        make.event_mode.into(),
                        make.early_return.into(),
                        std::ptr::null(),
                        0,
                        environment,
                        Some(log),
                        None,
                    )
                }
            }
        });
        for text in [name, token, resources] {
            outcome.damage.extend(text.damage(true));
        }
        outcome.status = Some(i32::from(!handle.is_null()));
        (outcome.log, outcome.strays) = messages(environment as usize);
        let co_simulation = make.co_simulation;
        let (environment, next_event) = (environment as usize, f64::INFINITY);
        self.store(
            index,
            Instance {
                handle: handle as usize,
                environment,
                co_simulation,
                next_event,
                _callbacks: callbacks,
            },
        );
    }

    /// Stores an instance. The callbacks of an earlier instance with this index, which was not freed, remain allocated.
    fn store(&self, index: usize, instance: Instance) {
        let before = match instance.handle {
            0 => locked(&self.instances).remove(&index),
            _ => locked(&self.instances).insert(index, instance),
        };
        std::mem::forget(before);
    }

    fn call(&self, instance: Option<usize>, function: &str, args: &[Arg], outcome: &mut Outcome) {
        let (handle, environment, co_simulation) = match instance {
            Some(index) => match locked(&self.instances).get(&index) {
                Some(instance) => (instance.handle, instance.environment, instance.co_simulation),
                // Instantiation failed, so the call is skipped.
                None => return,
            },
            None => (0, 0, self.setting.libraries[0].is_some()),
        };
        let Some(address) = self.find(co_simulation, function) else {
            outcome.missing = true;
            return;
        };
        let mut kept = Vec::new();
        let words: Vec<u64> = args.iter().map(|arg| self.word(arg, &mut kept)).collect();
        // SAFETY: the words are the arguments of the function; the FMU may still crash this process.
        let call = || in_fmu(|| unsafe { calls::call(address, function, handle as *mut c_void, &words) });
        let status = updates::iterate(function, call(), &kept, call);
        outcome.status = Some(status);
        let is_string = |kept: &Kept| matches!(kept.content, Content::Output(Kind::Pointer, _));
        if THREADS.load(Ordering::Relaxed) && kept.iter().any(is_string) {
            // Another thread may run before this one copies the strings.
            std::thread::sleep(std::time::Duration::from_micros(20));
        }
        let succeeded = status == 0 || status == 1;
        for Kept { array, content } in &kept {
            outcome.damage.extend(array.damage(matches!(content, Content::Input)));
            let values = match content {
                Content::Input => None,
                Content::Output(Kind::Pointer, _) if function == "fmi3GetBinary" && succeeded => {
                    std::mem::take(&mut outcome.written).first().map(|sizes| blobs(array, sizes))
                }
                Content::Output(kind, count) => Some(read(array, *kind, *count, succeeded)),
                Content::State(slot) => {
                    let handle = word_of(array);
                    locked(&self.states).insert(*slot, handle as usize);
                    Some(Values::Numbers(Kind::U8, vec![u64::from(handle != 0)]))
                }
                Content::Size(slot) => {
                    let size = word_of(array);
                    if succeeded {
                        locked(&self.sizes).insert(*slot, (size as usize).min(1 << 30));
                    }
                    Some(Values::Numbers(Kind::Size, vec![size]))
                }
                Content::Saved(slot) => {
                    locked(&self.bytes).insert(*slot, array.bytes().to_vec());
                    Some(read(array, Kind::U8, usize::MAX, succeeded))
                }
            };
            outcome.written.extend(values);
        }
        (outcome.log, outcome.strays) = messages(environment);
        if let (true, Some(index)) = (succeeded && function.ends_with("DiscreteStates"), instance)
            && let Some(instance) = locked(&self.instances).get_mut(&index)
        {
            instance.next_event = updates::next_event(&outcome.written).unwrap_or(f64::INFINITY);
        }
    }

    /// Returns the time of the next time event of an instance; infinite if there is none.
    fn next_event(&self, instance: usize) -> f64 {
        locked(&self.instances).get(&instance).map_or(f64::INFINITY, |instance| instance.next_event)
    }

    fn word(&self, arg: &Arg, kept: &mut Vec<Kept>) -> u64 {
        let mut keep = |array: Guarded, content: Content| {
            let address = array.address();
            kept.push(Kept { array, content });
            address
        };
        let mut input = |bytes: &[u8]| keep(Guarded::new(bytes), Content::Input);
        let words = |words: Vec<u64>| -> Vec<u8> {
            words.into_iter().flat_map(|word| (word as usize).to_ne_bytes()).collect()
        };
        match arg {
            Arg::Real(bits) => *bits,
            Arg::Integer(number) => *number as u64,
            Arg::Null => 0,
            Arg::In(kind, bits) => {
                let bytes: Vec<u8> =
                    bits.iter().flat_map(|bits| bits.to_ne_bytes().into_iter().take(kind.size())).collect();
                input(&bytes)
            }
            Arg::Strings(texts) => {
                let mut with_end = |text: &Vec<u8>| input(&[text.as_slice(), &[0]].concat());
                let pointers = texts.iter().map(|text| text.as_ref().map_or(0, &mut with_end)).collect();
                input(&words(pointers))
            }
            Arg::Blobs(blobs) => {
                let pointers = blobs.iter().map(|blob| input(blob)).collect();
                input(&words(pointers))
            }
            Arg::Saved(slot) => input(&locked(&self.bytes).get(slot).cloned().unwrap_or_default()),
            Arg::SavedSize(slot) => {
                let size = locked(&self.sizes).get(slot).copied();
                size.unwrap_or_else(|| locked(&self.bytes).get(slot).map_or(0, Vec::len)) as u64
            }
            Arg::State(slot) => locked(&self.states).get(slot).copied().unwrap_or(0) as u64,
            Arg::Out(kind, count) => keep(Guarded::room(kind.size() * count), Content::Output(*kind, *count)),
            Arg::StateOut(slot) => {
                let handle = locked(&self.states).get(slot).copied().unwrap_or(0);
                keep(Guarded::new(&handle.to_ne_bytes()), Content::State(*slot))
            }
            Arg::SizeOut(slot) => keep(Guarded::new(&0_usize.to_ne_bytes()), Content::Size(*slot)),
            Arg::SavedOut(slot) => {
                let size = locked(&self.sizes).get(slot).copied().unwrap_or(0);
                keep(Guarded::room(size), Content::Saved(*slot))
            }
        }
    }
}

/// Line of a worker that cannot load the library: the message of the loader.
#[derive(Serialize, Deserialize)]
pub struct Unloadable {
    pub unloadable: String,
}

fn word_of(array: &Guarded) -> u64 {
    array.bytes().try_into().map(usize::from_ne_bytes).unwrap_or_default() as u64
}

fn read(array: &Guarded, kind: Kind, count: usize, succeeded: bool) -> Values {
    let words = array.bytes().chunks_exact(kind.size()).take(count).map(|bytes| {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        u64::from_le_bytes(word)
    });
    if kind == Kind::Pointer {
        let untouched = u64::from_ne_bytes([FILL; 8]);
        let texts = words.map(|word| {
            let written = succeeded && word != untouched;
            // SAFETY: if the call succeeded, the pointers that it wrote point to strings.
            if written { unsafe { text_at(word as usize as *const c_char) } } else { None }
        });
        return Values::Strings(texts.collect());
    }
    Values::Numbers(kind, words.collect())
}

/// Returns the binary values that fmi3GetBinary returned as pointers and sizes.
fn blobs(pointers: &Guarded, sizes: &Values) -> Values {
    let (Values::Numbers(_, pointers), Values::Numbers(_, sizes)) =
        (read(pointers, Kind::Size, usize::MAX, true), sizes)
    else {
        return Values::Strings(Vec::new());
    };
    let blob = |(pointer, size): (u64, &u64)| {
        // SAFETY: the FMU has returned the address and the size of the bytes.
        (pointer != 0 && *size < 1 << 30).then(|| unsafe {
            std::slice::from_raw_parts(pointer as usize as *const u8, *size as usize).to_vec()
        })
    };
    Values::Strings(pointers.into_iter().zip(sizes).map(blob).collect())
}

/// Returns the new messages with this environment pointer, and separately those with a pointer that no instance has received, which are a
/// fault of the FMU.
fn messages(environment: usize) -> (Vec<Message>, Vec<Message>) {
    let mut messages = locked(&MESSAGES);
    let (mut own, mut strays) = (Vec::new(), Vec::new());
    let given = FIRST_ENVIRONMENT..ENVIRONMENTS.load(Ordering::Relaxed);
    messages.retain(|(source, message)| {
        if *source == environment {
            own.push(message.clone());
        } else if given.contains(source) && source % ENVIRONMENT_STEP == 0 {
            return true;
        } else {
            strays.push(message.clone());
        }
        false
    });
    (own, strays)
}

/// Returns the bytes of a string; `None` for NULL.
///
/// # Safety
/// The string has a NUL at its end.
pub unsafe fn text_at(pointer: *const c_char) -> Option<Vec<u8>> {
    // SAFETY: the caller's requirement.
    (!pointer.is_null()).then(|| unsafe { CStr::from_ptr(pointer) }.to_bytes().to_vec())
}

#[cfg(all(test, unix, not(all(target_vendor = "apple", target_arch = "aarch64"))))]
mod tests {
    use super::{FIRST_ENVIRONMENT, fmi2CallbackLogger, log_of_fmi2, messages};

    #[test]
    fn messages_of_fmi2_have_their_values() {
        let format = c"Wrong GUID %s, line %d of %s: t = %g, %5.1e, 100 %%";
        // SAFETY: the values have the types of the format.
        unsafe {
            let log = std::mem::transmute::<*const (), fmi2CallbackLogger>(log_of_fmi2 as *const ());
            let (token, path) = (c"{8c4e}".as_ptr(), c"model.fmu".as_ptr());
            log(
                FIRST_ENVIRONMENT as _,
                c"name".as_ptr(),
                0,
                c"".as_ptr(),
                format.as_ptr(),
                token,
                7,
                path,
                0.5,
                1e-9,
            );
        }
        let text = messages(FIRST_ENVIRONMENT).0.remove(0).text.unwrap_or_default();
        assert_eq!(
            String::from_utf8_lossy(&text),
            "Wrong GUID {8c4e}, line 7 of model.fmu: t = 0.5, 1.0e-09, 100 %"
        );
    }
}
