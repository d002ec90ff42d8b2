//! Call sequences and their results. `worker` executes call sequences, `shrink` shortens them, and `reproduce` writes them as
//! programs in C.

use serde::{Deserialize, Serialize};
use std::collections::HashMap;

macro_rules! kinds {
    ($($kind:ident $of:ty, $c:literal;)+) => {
        /// Type of the elements of an array; `Pointer` points to a string or to bytes.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum Kind { $($kind),+ }

        impl Kind {
            /// Returns the size of an element in bytes.
            pub const fn size(self) -> usize {
                match self { $(Self::$kind => size_of::<$of>()),+ }
            }

            /// Returns the name of the type in C.
            pub const fn c_name(self) -> &'static str {
                match self { $(Self::$kind => $c),+ }
            }

            /// Returns the number that these bits represent.
            #[allow(unreachable_patterns, reason = "floating-point numbers come first")]
            pub fn number(self, bits: u64) -> f64 {
                match self {
                    Self::F64 => f64::from_bits(bits),
                    Self::F32 => f64::from(f32::from_bits(bits as u32)),
                    $(Self::$kind => bits as $of as f64),+
                }
            }

            /// Returns the bits that represent a number.
            #[allow(unreachable_patterns, reason = "floating-point numbers come first")]
            pub fn bits(self, number: f64) -> u64 {
                match self {
                    Self::F64 => number.to_bits(),
                    Self::F32 => u64::from((number as f32).to_bits()),
                    $(Self::$kind => number as $of as u64 & (u64::MAX >> (64 - 8 * size_of::<$of>()))),+
                }
            }
        }
    };
}

kinds! {
    I8 i8, "int8_t";
    U8 u8, "uint8_t";
    I16 i16, "int16_t";
    U16 u16, "uint16_t";
    I32 i32, "int32_t";
    U32 u32, "uint32_t";
    I64 i64, "int64_t";
    U64 u64, "uint64_t";
    Size usize, "size_t";
    Pointer usize, "void *";
    F64 f64, "double";
    F32 f32, "float";
}

impl Kind {
    /// Returns whether the type is floating-point.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::F64 | Self::F32)
    }
}

/// Argument of a call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Arg {
    /// Bits of a floating-point number.
    Real(u64),
    /// An integer, a size or a Boolean.
    Integer(i64),
    /// NULL.
    Null,
    /// Array of numbers for the FMU to read, as their bits.
    In(Kind, Vec<u64>),
    /// Array of strings; `None` is NULL.
    Strings(Vec<Option<Vec<u8>>>),
    /// Array of pointers to bytes.
    Blobs(Vec<Vec<u8>>),
    /// Array to which the FMU writes this many results.
    Out(Kind, usize),
    /// Handle of the saved state at this index.
    State(usize),
    /// Pointer to the handle of the saved state at this index, which the call sets.
    StateOut(usize),
    /// Serialized state at this index, as bytes.
    Saved(usize),
    /// Number of bytes of the serialized state at this index.
    SavedSize(usize),
    /// Pointer that receives the size of the serialized state at this index.
    SizeOut(usize),
    /// Array that receives the serialized state at this index.
    SavedOut(usize),
}

impl Arg {
    pub fn real(number: f64) -> Self {
        Self::Real(number.to_bits())
    }
}

/// Arguments of an instantiation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Make {
    /// Whether the interface type is Co-Simulation.
    pub co_simulation: bool,
    pub name: String,
    /// `guid` of FMI 2.0 or `instantiationToken` of FMI 3.0.
    pub token: String,
    /// Value of `loggingOn`.
    pub logging: bool,
    /// Value of `eventModeUsed` (FMI 3.0).
    pub event_mode: bool,
    /// Value of `earlyReturnAllowed` (FMI 3.0).
    pub early_return: bool,
}

/// Integration of an FMU in Model Exchange.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Integration {
    pub begin: f64,
    pub end: f64,
    /// Number of steps if there are no events. It defines the step size; a step that reaches an event ends early.
    pub steps: usize,
    /// Whether the method is Euler's method instead of the classical Runge-Kutta method.
    pub euler: bool,
    /// Number of continuous states.
    pub states: usize,
    /// Number of event indicators.
    pub indicators: usize,
}

/// Index that represents a NULL instance, which may be freed.
pub const NULL_INSTANCE: usize = 999;

/// Step of a call sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Step {
    /// Instantiates the FMU; the instance gets this index.
    Make(usize, Make),
    Free(usize),
    /// Calls a function with the instance, or NULL if `instance` is `None`, and then `args` as arguments.
    Call {
        instance: Option<usize>,
        function: String,
        args: Vec<Arg>,
    },
    /// Calls a function that has no arguments and returns a string: the FMI version or the types platform.
    Version(String),
    /// Integrates an instance of Model Exchange and handles its events.
    Integrate(usize, Integration),
    /// Repeats steps this many times, or until `Setting::repetitions` seconds have passed.
    Repeat(usize, Vec<Numbered>),
    /// Runs call sequences at the same time, each in a separate thread.
    Parallel(Vec<Vec<Numbered>>),
    /// Measures memory, threads, open files and settings of the process.
    Measure,
    /// Continues in a new process. Only the serialized states are passed on to it.
    FreshProcess,
    /// Places the FMU in a directory with this name. It can only be the first step of a process, because the library is loaded from there.
    Elsewhere(String),
    Unload,
    /// Exits the process, which runs the destructors of its libraries. This is the last step of a sequence.
    Quit,
}

/// Step with a number that does not change when other steps are removed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Numbered {
    pub id: u32,
    /// Whether the standard forbids the call or its arguments. The state machine of `legal` ignores forbidden calls.
    pub forbidden: bool,
    pub step: Step,
}

/// Steps in the order of their execution.
pub type CallSequence = Vec<Numbered>;

/// Returns all steps of a sequence, including the steps within its repetitions and threads.
pub fn all_steps(sequence: &[Numbered]) -> Vec<&Numbered> {
    let steps = sequence.iter().flat_map(|numbered| {
        let inner = match &numbered.step {
            Step::Repeat(_, steps) => all_steps(steps),
            Step::Parallel(sequences) => sequences.iter().flat_map(|sequence| all_steps(sequence)).collect(),
            _ => Vec::new(),
        };
        std::iter::once(numbered).chain(inner)
    });
    steps.collect()
}

/// Returns the step with this number.
pub fn step_of(sequence: &[Numbered], id: u32) -> Option<&Numbered> {
    all_steps(sequence).into_iter().find(|numbered| numbered.id == id)
}

/// Message that the FMU logged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Message {
    pub status: i32,
    /// Bytes of the category; `None` is NULL.
    pub category: Option<Vec<u8>>,
    /// Bytes of the message; `None` is NULL.
    pub text: Option<Vec<u8>>,
}

/// Values of a variable or an array.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Values {
    /// Bits of numbers.
    Numbers(Kind, Vec<u64>),
    /// Strings or binary values; `None` is NULL.
    Strings(Vec<Option<Vec<u8>>>),
}

impl Values {
    /// Converts numbers to values of a type.
    pub fn new(kind: Kind, numbers: impl IntoIterator<Item = f64>) -> Self {
        Self::Numbers(kind, numbers.into_iter().map(|number| kind.bits(number)).collect())
    }

    /// Returns `size` copies of a string or binary value.
    pub fn strings(text: &[u8], size: usize) -> Self {
        Self::Strings(vec![Some(text.to_owned()); size])
    }

    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Numbers(kind, bits) => bits.iter().map(|bits| kind.number(*bits)).collect(),
            Self::Strings(_) => Vec::new(),
        }
    }

    /// Returns `size` values from the index `begin`; `None` if there are fewer.
    pub fn part(&self, begin: usize, size: usize) -> Option<Self> {
        Some(match self {
            Self::Numbers(kind, bits) => Self::Numbers(*kind, bits.get(begin..begin + size)?.to_vec()),
            Self::Strings(texts) => Self::Strings(texts.get(begin..begin + size)?.to_vec()),
        })
    }

    /// Formats the value at an index for messages.
    pub fn show(&self, index: usize) -> String {
        match self {
            Self::Numbers(kind, bits) => match bits.get(index).map(|bits| kind.number(*bits)) {
                Some(number) if kind.is_float() => format!("{number:?}"),
                Some(number) => number.to_string(),
                None => "nothing".to_owned(),
            },
            Self::Strings(texts) => match texts.get(index) {
                Some(Some(text)) => format!("{:?}", String::from_utf8_lossy(text)),
                _ => "NULL".to_owned(),
            },
        }
    }

    /// Returns the first index at which the values differ.
    pub fn differ(&self, other: &Self) -> Option<usize> {
        self.differ_beyond(other, 0.0, |_| 1.0)
    }

    /// Returns the first index at which the values differ. Floating-point numbers differ if their difference exceeds `tolerance`
    /// times the largest of both magnitudes and the nominal value at the index.
    pub fn differ_beyond(
        &self,
        other: &Self,
        tolerance: f64,
        nominal: impl Fn(usize) -> f64,
    ) -> Option<usize> {
        match (self, other) {
            (Self::Numbers(kind, one), Self::Numbers(_, two)) => {
                // Zeros of both signs are equal, and so are all NaNs.
                let equal = |index: usize, one: f64, two: f64| {
                    let scale = || one.abs().max(two.abs()).max(nominal(index));
                    one == two || one.is_nan() && two.is_nan() || (one - two).abs() <= tolerance * scale()
                };
                one.iter().zip(two).enumerate().position(|(index, (one, two))| {
                    one != two && !(kind.is_float() && equal(index, kind.number(*one), kind.number(*two)))
                })
            }
            (Self::Strings(one), Self::Strings(two)) => one.iter().zip(two).position(|(one, two)| one != two),
            _ => Some(0),
        }
    }
}

/// Result of a step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    pub id: u32,
    /// Status that the function returned. It is 1 for an instantiation that returned an instance, 0 for one that returned NULL,
    /// and 0 for FreeInstance.
    pub status: Option<i32>,
    /// Whether the library lacks the function.
    pub missing: bool,
    /// Contents of the arrays for results, in the order of the arguments.
    pub written: Vec<Values>,
    /// Messages that the FMU logged during the step.
    pub log: Vec<Message>,
    /// Messages that the FMU logged with an environment pointer that no instance has received.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub strays: Vec<Message>,
    /// Descriptions of writes outside of the arrays for results.
    pub damage: Vec<String>,
    /// String that the function for the version or the platform returned.
    pub text: Option<Vec<u8>>,
    /// Measurement; for repetitions, only their number.
    pub measured: Option<Measured>,
}

/// Memory, threads, open files and settings of the process.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Allocated bytes if `exact`, otherwise the resident memory of the process.
    pub memory: u64,
    /// Whether the C library reports the number of allocated bytes.
    pub exact: bool,
    pub threads: usize,
    pub files: usize,
    /// Settings of the process, such as the working directory and signal handlers, each with its value.
    pub settings: Vec<String>,
    /// Number of repetitions; 0 for a measurement.
    pub times: usize,
}

/// End of the process that executed a call sequence.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum End {
    /// The last step returned.
    #[default]
    Done,
    /// The process crashed, for this reason.
    Crash(String),
    /// The process did not end within this limit in seconds.
    Hang(f64),
    /// The process exited before the last step returned, with this status.
    Exit(i32),
    /// The library cannot be loaded, for this reason.
    Unloadable(String),
    /// The FMU started this many processes, which is more than the limit, so all were ended.
    Flood(usize),
}

/// Result of a call sequence.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Results by the number of the step.
    pub outcomes: HashMap<u32, Outcome>,
    pub end: End,
    /// Number of the first step without a result, in which the process ended; `None` if all steps have results.
    pub at: Option<u32>,
    /// Output on the standard output and the standard error.
    pub output: String,
    /// Names of the child processes that were alive after the end of the call sequence.
    pub orphans: Vec<String>,
}

impl Run {
    pub fn outcome(&self, id: u32) -> Option<&Outcome> {
        self.outcomes.get(&id)
    }

    pub fn status(&self, id: u32) -> Option<i32> {
        self.outcome(id)?.status
    }

    /// Returns whether a call returned OK or Warning.
    pub fn succeeds(&self, id: u32) -> bool {
        self.status(id).is_some_and(|status| status <= 1)
    }

    /// Returns the contents of the first array for results of a step.
    pub fn written(&self, id: u32) -> Option<&Values> {
        self.outcome(id)?.written.first()
    }
}

/// Parameters that all call sequences of an FMU share.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Setting {
    /// Whether the FMI version is 3.0 instead of 2.0.
    pub fmi3: bool,
    /// Paths of the libraries for Co-Simulation and for Model Exchange.
    pub libraries: [Option<std::path::PathBuf>; 2],
    pub resources: std::path::PathBuf,
    /// Maximum address space of a process in bytes.
    pub memory: u64,
    /// Whether memory after each array is accessible, so that a write there is detected instead of crashing.
    pub soft: bool,
    /// Whether the loader resolves all symbols when it loads the library, as in some importers.
    pub now: bool,
    /// Maximum duration of a `Repeat` step in seconds.
    pub repetitions: f64,
}
