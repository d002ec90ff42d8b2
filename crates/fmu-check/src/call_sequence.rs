//! Call sequences and their results as data. A worker plays them, a shrinker shortens them, a printer writes them
//! as programs.

use serde::{Deserialize, Serialize};
use std::collections::HashMap;

macro_rules! kinds {
    ($($kind:ident $of:ty, $c:literal;)+) => {
        /// The kinds of numbers in arrays; `Pointer` points to strings or to bytes.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
        pub enum Kind { $($kind),+ }

        impl Kind {
            /// The bytes of one.
            pub const fn size(self) -> usize {
                match self { $(Self::$kind => size_of::<$of>()),+ }
            }

            /// The type in C.
            pub const fn c_name(self) -> &'static str {
                match self { $(Self::$kind => $c),+ }
            }

            /// The number behind bits.
            #[allow(unreachable_patterns, reason = "floating-point numbers come first")]
            pub fn number(self, bits: u64) -> f64 {
                match self {
                    Self::F64 => f64::from_bits(bits),
                    Self::F32 => f64::from(f32::from_bits(bits as u32)),
                    $(Self::$kind => bits as $of as f64),+
                }
            }

            /// The bits of a number.
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
    /// Whether it is a floating-point number.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::F64 | Self::F32)
    }
}

/// One argument of a call.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Arg {
    /// A floating-point number, as its bits.
    Real(u64),
    /// An integer, a size or a Boolean.
    Whole(i64),
    /// NULL.
    Null,
    /// An array of numbers, as their bits.
    In(Kind, Vec<u64>),
    /// An array of strings; `None` is NULL.
    Texts(Vec<Option<Vec<u8>>>),
    /// An array of pointers to bytes.
    Blobs(Vec<Vec<u8>>),
    /// Room for so many numbers.
    Out(Kind, usize),
    /// A saved state, by the number of its index.
    State(usize),
    /// The index of a saved state.
    StateOut(usize),
    /// Serialized bytes, by the number of their index.
    Saved(usize),
    /// The number of these bytes.
    SavedSize(usize),
    /// Receives the size of these bytes.
    SizeOut(usize),
    /// Receives these bytes, up to the size.
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
    /// The guid or instantiationToken.
    pub token: String,
    /// Whether it logs.
    pub logging: bool,
    /// Whether the importer handles events (FMI 3.0).
    pub event_mode: bool,
    /// Whether steps may return early (FMI 3.0).
    pub early_return: bool,
}

/// The index of an instance that is NULL: freeing it is allowed.
pub const NULL_INSTANCE: usize = 999;

/// A step of a sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Step {
    /// A new instance at this index.
    Make(usize, Make),
    Free(usize),
    /// Calls a function of an instance, or of NULL, with the arguments after the instance.
    Call {
        instance: Option<usize>,
        function: String,
        args: Vec<Arg>,
    },
    /// Calls that need no instance: the version and the platform.
    Version(String),
    /// Repeats steps this many times, or until the time limit.
    Repeat(usize, Vec<Numbered>),
    /// Runs call sequences at the same time, each in a separate thread.
    Parallel(Vec<Vec<Numbered>>),
    /// Measures memory, threads and settings of the process.
    Measure,
    /// Continues in a new process, which receives only serialized bytes.
    FreshProcess,
    Unload,
    /// Exits the process, which runs the destructors of its libraries. Must be the last step.
    Quit,
}

/// A step with a number that it keeps when others are left out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Numbered {
    pub id: u32,
    /// Whether the standard forbids the call. Such calls are not considered in the check of the following ones.
    pub forbidden: bool,
    pub step: Step,
}

/// A sequence of calls.
pub type CallSequence = Vec<Numbered>;

/// Returns all steps of a sequence, including those of its repetitions and threads.
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

/// A message of the FMU.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Message {
    pub status: i32,
    /// Its category, as bytes; `None` is NULL.
    pub category: Option<Vec<u8>>,
    /// The message, as bytes; `None` is NULL.
    pub text: Option<Vec<u8>>,
}

/// Values of a variable or an array.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Values {
    /// Numbers, as their bits.
    Numbers(Kind, Vec<u64>),
    /// Texts or bytes; `None` is NULL.
    Texts(Vec<Option<Vec<u8>>>),
}

impl Values {
    /// Numbers of a kind.
    pub fn new(kind: Kind, numbers: impl IntoIterator<Item = f64>) -> Self {
        Self::Numbers(kind, numbers.into_iter().map(|number| kind.bits(number)).collect())
    }

    /// A string or bytes for each element.
    pub fn texts(text: &[u8], size: usize) -> Self {
        Self::Texts(vec![Some(text.to_owned()); size])
    }

    pub fn numbers(&self) -> Vec<f64> {
        match self {
            Self::Numbers(kind, bits) => bits.iter().map(|bits| kind.number(*bits)).collect(),
            Self::Texts(_) => Vec::new(),
        }
    }

    /// This many values, starting at an index.
    pub fn part(&self, begin: usize, size: usize) -> Option<Self> {
        Some(match self {
            Self::Numbers(kind, bits) => Self::Numbers(*kind, bits.get(begin..begin + size)?.to_vec()),
            Self::Texts(texts) => Self::Texts(texts.get(begin..begin + size)?.to_vec()),
        })
    }

    /// The value at an index, formatted for people.
    pub fn show(&self, index: usize) -> String {
        match self {
            Self::Numbers(kind, bits) => match bits.get(index).map(|bits| kind.number(*bits)) {
                Some(number) if kind.is_float() => format!("{number:?}"),
                Some(number) => number.to_string(),
                None => "nothing".to_owned(),
            },
            Self::Texts(texts) => match texts.get(index) {
                Some(Some(text)) => format!("{:?}", String::from_utf8_lossy(text)),
                _ => "NULL".to_owned(),
            },
        }
    }

    /// The first index at which two differ.
    pub fn differ(&self, other: &Self) -> Option<usize> {
        match (self, other) {
            (Self::Numbers(kind, one), Self::Numbers(_, two)) => {
                // Zeros of both signs are equal, and so are all NaNs.
                let equal =
                    |one: f64, two: f64| kind.is_float() && (one == two || one.is_nan() && two.is_nan());
                one.iter()
                    .zip(two)
                    .position(|(one, two)| one != two && !equal(kind.number(*one), kind.number(*two)))
            }
            (Self::Texts(one), Self::Texts(two)) => one.iter().zip(two).position(|(one, two)| one != two),
            _ => Some(0),
        }
    }
}

/// The result of one step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    pub id: u32,
    /// Status of the function; for an instantiation, 1 for an instance and 0 for NULL.
    pub status: Option<i32>,
    /// The library has no such function.
    pub missing: bool,
    /// Values that were written to the arrays, in the order of the arguments.
    pub written: Vec<Values>,
    /// Messages of the FMU during the step.
    pub log: Vec<Message>,
    /// Writes outside of the arrays.
    pub damage: Vec<String>,
    /// The string that a version function returned.
    pub text: Option<Vec<u8>>,
    /// Result of a measurement or of repetitions.
    pub measured: Option<Measured>,
}

/// Memory, threads and settings of the process.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Bytes in use as counted by the C library; if it does not count them, memory of the whole process.
    pub memory: u64,
    /// Whether the C library counted them.
    pub exact: bool,
    pub threads: usize,
    pub files: usize,
    /// Settings of the process: rounding, locale, working directory, signal handlers.
    pub settings: Vec<String>,
    /// Number of repetitions.
    pub times: usize,
}

/// How a sequence ended.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum End {
    /// Ended after its last step.
    #[default]
    Done,
    /// The process crashed, for this reason.
    Crash(String),
    /// The process did not end in time.
    Hang(f64),
    /// The library called `exit`.
    Exit(i32),
    /// The library cannot be loaded, for this reason.
    Unloadable(String),
    /// The FMU started too many processes, which were ended.
    Flood(usize),
}

/// The result of a call sequence.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Results by the number of the step.
    pub outcomes: HashMap<u32, Outcome>,
    pub end: End,
    /// The step in which it ended, if not with the last.
    pub at: Option<u32>,
    /// Output on the standard output and the standard error.
    pub output: String,
    /// Names of the processes that were left at its end.
    pub orphans: Vec<String>,
}

impl Run {
    pub fn outcome(&self, id: u32) -> Option<&Outcome> {
        self.outcomes.get(&id)
    }

    pub fn status(&self, id: u32) -> Option<i32> {
        self.outcome(id)?.status
    }

    /// Whether a step returned OK or a warning.
    pub fn succeeds(&self, id: u32) -> bool {
        self.status(id).is_some_and(|status| status <= 1)
    }

    /// The first array that a step wrote.
    pub fn written(&self, id: u32) -> Option<&Values> {
        self.outcome(id)?.written.first()
    }
}

/// The setting that all call sequences of an FMU share.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Setting {
    /// FMI 3.0, not 2.0.
    pub fmi3: bool,
    /// The library of Co-Simulation and of Model Exchange.
    pub libraries: [Option<std::path::PathBuf>; 2],
    pub resources: std::path::PathBuf,
    /// Bytes of memory at most.
    pub memory: u64,
    /// Memory after each array is accessible, to detect writes there.
    pub soft: bool,
    /// All symbols are looked up when the library is loaded, as some importers do.
    pub now: bool,
    /// Seconds of repetitions at most.
    pub repetitions: f64,
}
