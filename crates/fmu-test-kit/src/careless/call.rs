//! One call of a function that works on an instance, and what a standard says of its functions.

use super::arguments::CallArguments;
use crate::Either;
use crate::serialized::fnv1a;
use fmu_export::{Standard, Status};
use std::ffi::{CStr, c_char};

/// A function with its arguments.
#[derive(Clone, Debug)]
pub struct Call {
    pub function: &'static str,
    pub arguments: CallArguments,
}

/// What a call answered, as bits: NaN compares too.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    pub status: Status,
    pub values: Vec<u64>,
}

/// A standard as the careless importer speaks it.
#[allow(missing_docs, reason = "names of functions")]
pub trait Caller: Either + Sized {
    const STANDARD: Standard;
    /// What importers call most in Co-Simulation.
    const STEPS: &'static [&'static str];
    /// What they call most in Model Exchange.
    const INTEGRATION: &'static [&'static str];
    /// From a reset to the end of the initialization.
    const BEGINNING: &'static [&'static str];
    /// For Co-Simulation and for Model Exchange.
    const INSTANTIATE: [&'static str; 2];
    const FREE: &'static str;
    /// Of saved states: get, set, free, size, serialize, de-serialize.
    const HANDLES: [&'static str; 6];

    /// Checks what needs no instance; the names of the functions.
    fn check_version(&self) -> &'static [&'static str];

    /// Calls the function with these arguments.
    fn call(&self, function: &'static str, out: &mut Outputs) -> Status;
}

/// The functions of saved states have handles besides arguments: the session calls them.
pub fn has_handles(function: &str) -> bool {
    function.contains("FMUstate") || function.contains("FMUState")
}

impl Call {
    /// Whether the state must be the same after an answer with this status. A step that ends early in FMI 2.0 has got
    /// somewhere.
    pub fn must_not_change(&self, status: Status) -> bool {
        let early = self.function == "fmi2DoStep" && status == Status::Discard;
        status != Status::Ok && !early || self.function[4..].starts_with("Get")
    }

    /// Calls the function. Panics if it answers what it must not: a status that no function here has, a value that is no
    /// finite number, more values than were asked for.
    pub fn run<F: Caller>(&self, fmu: &F) -> Answer {
        let mut out = Outputs { arguments: &self.arguments, values: Vec::new() };
        let (name, status) = (self.function, fmu.call(self.function, &mut out));
        let discards = (name.ends_with("Status") || name.ends_with("DoStep")) && status == Status::Discard;
        assert!(discards || [Status::Ok, Status::Error].contains(&status), "{name} answers {status:?}");
        if name.ends_with("DoStep") && status == Status::Ok {
            let [point, size, _] = self.arguments.numbers;
            assert!(size > 0.0 && (point + size).is_finite(), "time does not pass: {self:?}");
        }
        Answer { status, values: out.values }
    }
}

/// What a call wrote.
pub struct Outputs<'a> {
    pub arguments: &'a CallArguments,
    pub values: Vec<u64>,
}

impl<'a> Outputs<'a> {
    /// Calls with an array of `count` values to write: nothing is written behind it. `fault` is the place of what may be
    /// wrong with the pointer.
    pub fn array<T: Clone + PartialEq>(
        &mut self,
        (fault, count): (usize, usize),
        untouched: T,
        call: impl FnOnce(*mut T) -> Status,
        bits: impl Fn(&T) -> u64,
    ) -> Status {
        let mut array = vec![untouched.clone(); count.max(1) + 1];
        let status = call(self.arguments.output(fault, &mut array));
        assert!(array[count..].iter().all(|value| *value == untouched), "too much: {:?}", self.arguments);
        if status == Status::Ok {
            self.values.extend(array[..count].iter().map(bits));
        }
        status
    }

    /// The same with real numbers.
    pub fn reals(&mut self, places: (usize, usize), call: impl FnOnce(*mut f64) -> Status) -> Status {
        self.array(places, f64::INFINITY, call, |value| finite(*value))
    }

    /// The same with texts.
    pub fn texts(&mut self, call: impl FnOnce(*mut *const c_char) -> Status) -> Status {
        let places = (1, self.arguments.values);
        self.array(places, UNTOUCHED_TEXT.as_ptr(), call, |text| {
            assert!(!text.is_null() && *text != UNTOUCHED_TEXT.as_ptr(), "no text");
            // SAFETY: a string of the FMU's, valid until the next call.
            let bytes = unsafe { CStr::from_ptr(*text) }.to_bytes();
            assert!(std::str::from_utf8(bytes).is_ok(), "no UTF-8: {bytes:?}");
            u64::from_le_bytes(fnv1a(bytes))
        })
    }
}

static UNTOUCHED_TEXT: &CStr = c"untouched";

/// The bits of a number, which is one.
pub fn finite(value: f64) -> u64 {
    assert!(value.is_finite(), "{value} is no number to answer");
    value.to_bits()
}

/// The bits of a truth value, which is one.
pub fn truth(flag: impl Into<i64>) -> u64 {
    let flag = flag.into();
    assert!([0, 1].contains(&flag), "{flag} is no truth value");
    flag as u64
}
