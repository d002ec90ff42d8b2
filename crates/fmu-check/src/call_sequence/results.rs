//! Results of call sequences.

use super::Kind;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::sync::Arc;

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

    /// Returns values that differ from these, and are unlikely to be values of the FMU.
    pub fn others(&self) -> Self {
        let other =
            |number: f64| if number.is_finite() { number + 1234.5 + 0.37 * number.abs() } else { 0.0 };
        match self {
            Self::Numbers(kind, _) => Self::new(*kind, self.numbers().into_iter().map(other)),
            Self::Strings(texts) => {
                let other =
                    |text: &Option<Vec<u8>>| Some([text.as_deref().unwrap_or_default(), b"x"].concat());
                Self::Strings(texts.iter().map(other).collect())
            }
        }
    }

    /// Formats the value at an index for messages.
    pub fn show(&self, index: usize) -> String {
        match self {
            Self::Numbers(kind, bits) => {
                bits.get(index).map_or_else(|| "nothing".to_owned(), |bits| kind.show(*bits))
            }
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

/// Result of an action.
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
    /// Messages that the FMU logged during the action.
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
    /// The last action returned.
    #[default]
    Done,
    /// The process crashed, for this reason.
    Crash(String),
    /// The process did not end within this limit in seconds.
    Hang(f64),
    /// The process exited before the last action returned, with this status.
    Exit(i32),
    /// The library cannot be loaded, for this reason.
    Unloadable(String),
    /// The FMU started this many processes, which is more than the limit, so all were ended.
    Flood(usize),
}

/// Result of a call sequence.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Results by the number of the action. They are shared, because the search for evidence copies a run many times.
    pub outcomes: HashMap<u32, Arc<Outcome>>,
    pub end: End,
    /// Number of the first action without a result, in which the process ended; `None` if all actions have results.
    pub at: Option<u32>,
    /// Output on the standard output and the standard error.
    pub output: String,
    /// Names of the child processes that were alive after the end of the call sequence.
    pub orphans: Vec<String>,
}

impl Run {
    pub fn outcome(&self, id: u32) -> Option<&Outcome> {
        self.outcomes.get(&id).map(Arc::as_ref)
    }

    pub fn status(&self, id: u32) -> Option<i32> {
        self.outcome(id)?.status
    }

    /// Returns whether a call returned OK or Warning.
    pub fn succeeds(&self, id: u32) -> bool {
        self.status(id).is_some_and(|status| status <= 1)
    }

    /// Returns the contents of the first array for results of an action.
    pub fn written(&self, id: u32) -> Option<&Values> {
        self.outcome(id)?.written.first()
    }
}
