//! Libraries, instances and saved states of a worker, and calls of the functions of the FMU.

use super::arrays::{Content, PassedArray, blobs, read, word_of};
use super::job::{EXECUTED, Unloadable};
use super::logger::{ENVIRONMENT_STEP, ENVIRONMENTS, Recorder, messages};
use super::memory::{Guarded, in_fmu};
use super::{locked, updates};
use crate::call_sequence::{Arg, Kind, Make, Outcome, Setting, Values};
use fmi_abi::c_types::{c_char, c_void};
use fmi_abi::calls::{Functions, Instantiation, Library, callbacks, log_callback};
use fmi_abi::fmi2::types::fmi2CallbackFunctions;
use fmi_abi::{Interface, Standard};
use serde::Serialize;
use std::collections::HashMap;
use std::ffi::CString;
use std::fs::File;
use std::io::Write as _;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Whether call sequences are being executed on several threads.
pub static THREADS: AtomicBool = AtomicBool::new(false);

/// Identifier of the process that executes the call sequence.
pub static PROCESS: AtomicU32 = AtomicU32::new(0);

/// Number of calls that have returned strings on several threads.
static STRING_CALLS: AtomicUsize = AtomicUsize::new(0);

/// Waits until another thread has called a function that returns strings, at most 2 ms. So other threads can overwrite the strings before
/// this thread copies them, in case the FMU has one buffer for all instances.
fn wait_for_another_thread() {
    let (own, begin) = (STRING_CALLS.fetch_add(1, Ordering::Relaxed) + 1, Instant::now());
    while STRING_CALLS.load(Ordering::Relaxed) == own && begin.elapsed() < Duration::from_millis(2) {
        std::thread::sleep(Duration::from_micros(20));
    }
}

/// Instance of the FMU; `environment` is the environment pointer that was passed to its instantiation.
pub struct Instance {
    pub handle: usize,
    pub environment: usize,
    pub co_simulation: bool,
    /// Time of the next time event; infinite if there is none.
    pub next_event: f64,
    /// Callbacks of FMI 2.0, which must outlive the instance.
    pub _callbacks: Option<Box<fmi2CallbackFunctions>>,
}

// SAFETY: the callbacks are only read.
unsafe impl Send for Instance {}

/// State of a process that executes a call sequence.
pub struct Executor {
    pub setting: Setting,
    /// Loaded libraries of Co-Simulation and Model Exchange.
    pub libraries: Mutex<[Option<&'static Library>; 2]>,
    pub instances: Mutex<HashMap<usize, Instance>>,
    /// Handles of the saved states, by index.
    pub states: Mutex<HashMap<usize, usize>>,
    /// Serialized states, by index.
    pub bytes: Mutex<HashMap<usize, Vec<u8>>>,
    /// Sizes of serialized states that the FMU has returned, by index.
    pub sizes: Mutex<HashMap<usize, usize>>,
    /// File for the outcomes of the actions.
    pub file: Mutex<File>,
    /// Number of the action before which this process waits for a debugger.
    pub stop_before: Option<u32>,
    /// Stamp of the job.
    pub stamp: u64,
}

impl Executor {
    /// Writes a line with the stamp of the job and JSON to the file.
    pub fn write(&self, line: &impl Serialize) {
        #[cfg(unix)]
        if std::process::id() != PROCESS.load(Ordering::Relaxed) {
            // The FMU has forked this process. The child process waits until the server ends it.
            loop {
                // SAFETY: only waits for a signal.
                unsafe { libc::pause() };
            }
        }
        let mut text = format!("{} ", self.stamp).into_bytes();
        if serde_json::to_writer(&mut text, line).is_ok() {
            text.push(b'\n');
        }
        // If the disk is full, results are lost, and the checker reports that the process has ended early.
        let _ = locked(&self.file).write_all(&text);
    }

    /// Returns the FMI version of the FMU.
    fn standard(&self) -> Standard {
        if self.setting.fmi3 { Standard::Fmi3 } else { Standard::Fmi2 }
    }

    /// Returns the name of a function with its prefix.
    pub fn named(&self, end: &str) -> String {
        format!("{}{end}", if self.setting.fmi3 { "fmi3" } else { "fmi2" })
    }

    /// Returns the functions of the FMU if they include the one of this name, and loads the library first if necessary; `None` if the
    /// library lacks the function. Ends the process if the library cannot be loaded.
    pub fn find(&self, co_simulation: bool, name: &str) -> Option<&'static Functions> {
        let index = usize::from(!co_simulation);
        let mut libraries = locked(&self.libraries);
        if libraries[index].is_none() {
            let path = self.setting.libraries[index].as_ref()?;
            if index == 1 && self.setting.libraries[0].as_ref() == Some(path) && libraries[0].is_some() {
                libraries[1] = libraries[0];
            } else {
                // SAFETY: loading the library may run any code of the FMU, in a process that may crash.
                match in_fmu(|| unsafe { Library::load(path, self.standard()) }) {
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
        libraries[index].filter(|library| library.find(name).is_ok()).map(Library::functions)
    }

    /// Instantiates the FMU, and stores the instance at an index.
    pub fn make(&self, index: usize, make: &Make, outcome: &mut Outcome) {
        // Strings are unmapped after the call: an FMU must copy the strings that it uses later.
        let text = |text: &str| Guarded::new(&CString::new(text).unwrap_or_default().into_bytes_with_nul());
        let (name, token) = (text(&make.name), text(&make.token));
        let standard = self.standard();
        let location = standard.resources(&self.setting.resources);
        let resources = Guarded::new(location.as_bytes_with_nul());
        let word = |text: &Guarded| text.address() as usize as *const c_char;
        // Section 2.3.1 of FMI 3.0.2: NULL if the FMU has no resources.
        let has_resources = standard == Standard::Fmi2 || self.setting.resources.is_dir();
        // Each instance gets a different environment pointer. It is not a valid address, because the FMU must not dereference it.
        let environment = ENVIRONMENTS.fetch_add(ENVIRONMENT_STEP, Ordering::Relaxed) as *mut c_void;
        let callbacks = Box::new(callbacks::<Recorder>(environment));
        let interface = if make.co_simulation { Interface::CoSimulation } else { Interface::ModelExchange };
        let arguments = Instantiation {
            interface: interface as _,
            name: word(&name),
            token: word(&token),
            resources: if has_resources { word(&resources) } else { std::ptr::null() },
            visible: make.visible.into(),
            logging_on: make.logging.into(),
            callbacks: &raw const *callbacks,
            environment,
            log: Some(log_callback::<Recorder>()),
            event_mode_used: make.event_mode.into(),
            early_return_allowed: make.early_return.into(),
            ..Instantiation::ZEROS
        };
        let Some(functions) = self.find(make.co_simulation, arguments.function(standard)) else {
            outcome.missing = true;
            return;
        };
        // SAFETY: the function has the type of the standard, and the arguments are as the standard requires.
        let handle = in_fmu(|| unsafe { functions.instantiate(&arguments) });
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
                _callbacks: Some(callbacks),
            },
        );
    }

    /// Stores an instance, or only removes the earlier one with this index if the handle is NULL. If an earlier instance with
    /// this index was not freed, its callbacks remain allocated, because the FMU may still use them.
    fn store(&self, index: usize, instance: Instance) {
        let before = match instance.handle {
            0 => locked(&self.instances).remove(&index),
            _ => locked(&self.instances).insert(index, instance),
        };
        std::mem::forget(before);
    }

    /// Calls a function, and stores the states that it writes; skips the call if its instance does not exist.
    pub fn call(&self, instance: Option<usize>, function: &str, args: &[Arg], outcome: &mut Outcome) {
        let (handle, environment, co_simulation) = match instance {
            Some(index) => match locked(&self.instances).get(&index) {
                Some(instance) => (instance.handle, instance.environment, instance.co_simulation),
                // The instantiation failed, so the call is skipped.
                None => return,
            },
            None => (0, 0, self.setting.libraries[0].is_some()),
        };
        let Some(functions) = self.find(co_simulation, function) else {
            outcome.missing = true;
            return;
        };
        let mut arrays = Vec::new();
        let words: Vec<u64> = args.iter().map(|arg| self.argument(arg, &mut arrays)).collect();
        // SAFETY: the words are the arguments of the function; the FMU may still crash this process.
        let call =
            || in_fmu(|| unsafe { functions.call(function, handle as *mut c_void, &words) }).unwrap_or(-1);
        let status = updates::iterate(function, call(), &arrays, call);
        outcome.status = Some(status);
        let is_string = |array: &PassedArray| matches!(array.content, Content::Output(Kind::Pointer, _));
        if THREADS.load(Ordering::Relaxed) && arrays.iter().any(is_string) {
            wait_for_another_thread();
        }
        let succeeded = status == 0 || status == 1;
        for PassedArray { array, content } in &arrays {
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
    pub fn next_event(&self, instance: usize) -> f64 {
        locked(&self.instances).get(&instance).map_or(f64::INFINITY, |instance| instance.next_event)
    }

    /// Returns an argument as 64 bits, and adds the arrays that it needs to `arrays`.
    fn argument(&self, arg: &Arg, arrays: &mut Vec<PassedArray>) -> u64 {
        let mut pass = |array: Guarded, content: Content| {
            let address = array.address();
            arrays.push(PassedArray { array, content });
            address
        };
        let mut input = |bytes: &[u8]| pass(Guarded::new(bytes), Content::Input);
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
            Arg::Out(kind, count) => {
                pass(Guarded::for_results(kind.size() * count), Content::Output(*kind, *count))
            }
            Arg::StateOut(slot) => {
                let handle = locked(&self.states).get(slot).copied().unwrap_or(0);
                pass(Guarded::new(&handle.to_ne_bytes()), Content::State(*slot))
            }
            Arg::SizeOut(slot) => pass(Guarded::new(&0_usize.to_ne_bytes()), Content::Size(*slot)),
            Arg::SavedOut(slot) => {
                let size = locked(&self.sizes).get(slot).copied().unwrap_or(0);
                pass(Guarded::for_results(size), Content::Saved(*slot))
            }
        }
    }
}
