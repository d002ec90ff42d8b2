//! Call sequences and their results. `worker` executes call sequences, `shrink` shortens them, and reports contain them, so that
//! `replay` can execute them again.

mod fold;
mod results;

pub use fold::{fold, unfold};
pub use results::{End, Measured, Message, Outcome, Run, Values};

use serde::{Deserialize, Serialize};

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

    /// Formats the number that these bits represent, with all its digits.
    pub fn show(self, bits: u64) -> String {
        match self {
            Self::F64 | Self::F32 => format!("{:?}", self.number(bits)),
            Self::I64 => (bits as i64).to_string(),
            Self::U64 | Self::Size | Self::Pointer => bits.to_string(),
            _ => self.number(bits).to_string(),
        }
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
    /// Value of `visible`.
    pub visible: bool,
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

/// Action of a call sequence.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Action {
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
    /// Repeats actions this many times, or until `Setting::repetitions` seconds have passed.
    Repeat(usize, Vec<Numbered>),
    /// Runs call sequences at the same time, each in a separate thread.
    Parallel(Vec<Vec<Numbered>>),
    /// Copies of actions, only in reports: their number, the difference between the numbers of an action in two successive copies,
    /// and the actions of the first copy.
    Copies(usize, u32, Vec<Numbered>),
    /// Measures memory, threads, open files and settings of the process.
    Measure,
    /// Continues in a new process. Only the serialized states are passed on to it.
    FreshProcess,
    /// Places the FMU in a directory with this name. It can only be the first action of a process, because the library is loaded from there.
    Elsewhere(String),
    /// Uses another working directory, home directory, language and time zone. It can only be the first action of a process.
    Environment,
    Unload,
    /// Exits the process, which runs the destructors of its libraries. This is the last action of a sequence.
    Quit,
}

/// Action with a number that does not change when other actions are removed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Numbered {
    pub id: u32,
    /// Whether the standard forbids the call or its arguments. The state machine of `legal` ignores forbidden calls.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub forbidden: bool,
    #[serde(rename = "step")]
    pub action: Action,
}

/// Actions in the order of their execution.
pub type CallSequence = Vec<Numbered>;

/// Returns all actions of a sequence, including the actions within its repetitions and threads.
pub fn all_actions(sequence: &[Numbered]) -> Vec<&Numbered> {
    let actions = sequence.iter().flat_map(|numbered| {
        let inner = match &numbered.action {
            Action::Repeat(_, actions) | Action::Copies(_, _, actions) => all_actions(actions),
            Action::Parallel(sequences) => {
                sequences.iter().flat_map(|sequence| all_actions(sequence)).collect()
            }
            _ => Vec::new(),
        };
        std::iter::once(numbered).chain(inner)
    });
    actions.collect()
}

/// Returns the action with this number.
pub fn action_of(sequence: &[Numbered], id: u32) -> Option<&Numbered> {
    all_actions(sequence).into_iter().find(|numbered| numbered.id == id)
}

/// Returns a short description of an action.
pub fn action_name(action: &Action) -> String {
    match action {
        Action::Make(..) => "the instantiation".to_owned(),
        Action::Free(_) => "FreeInstance".to_owned(),
        Action::Call { function, .. } | Action::Version(function) => function.clone(),
        Action::Repeat(times, actions) => format!(
            "one of {times} repetitions of {}",
            actions.first().map_or("nothing".to_owned(), |numbered| action_name(&numbered.action))
        ),
        Action::Parallel(sequences) => format!("a call on one of {} threads", sequences.len()),
        Action::Integrate(..) => "an integration".to_owned(),
        Action::Copies(times, ..) => format!("one of {times} copies of calls"),
        Action::Measure => "a measurement".to_owned(),
        Action::FreshProcess => "a fresh process".to_owned(),
        Action::Elsewhere(_) => "another directory".to_owned(),
        Action::Environment => "another environment".to_owned(),
        Action::Unload => "unloading the library".to_owned(),
        Action::Quit => "the exit of the process".to_owned(),
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
    /// Maximum duration of a `Repeat` action in seconds.
    pub repetitions: f64,
}
