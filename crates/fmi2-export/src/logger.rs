//! Log messages, delivered so that every importer shows them as they are.
//!
//! The callback is variadic and its message a `printf` format, but some importers never expand it
//! and others look for `#r1#` in it. So the text is complete before it is handed over, free of `%`
//! and of `#`, and there are no further arguments.

use crate::types::Status;
use std::ffi::{CStr, CString};

/// What a message is about; becomes `LogCategories` (section 2.2.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Category {
    /// The course of the simulation.
    Events,
    /// A question that has no answer (fmi2Discard).
    Discard,
    /// A call was refused.
    Error,
    /// The instance is broken.
    Fatal,
    /// Every category.
    All,
}

impl Category {
    /// All categories, for the model description.
    pub const ALL: [Self; 5] = [Self::Events, Self::Discard, Self::Error, Self::Fatal, Self::All];

    /// The name, as section 2.2.4 proposes it.
    pub const fn name(self) -> &'static CStr {
        match self {
            Self::Events => c"logEvents",
            Self::Discard => c"logStatusDiscard",
            Self::Error => c"logStatusError",
            Self::Fatal => c"logStatusFatal",
            Self::All => c"logAll",
        }
    }

    /// One sentence for the model description.
    pub const fn description(self) -> &'static str {
        match self {
            Self::Events => "The course of the simulation: instantiation, initialization, reset, termination",
            Self::Discard => "A question about the step has no answer; the simulation goes on",
            Self::Error => "A call was refused; the message says why and what to do",
            Self::Fatal => "The instance is broken and can only be freed",
            Self::All => "All of the above",
        }
    }

    const fn bit(self) -> u8 {
        match self {
            Self::All => 0b1111,
            other => 1 << other as u8,
        }
    }
}

/// Where messages go. Implemented at the boundary, for the importer's callback.
pub(crate) trait Sink {
    /// Delivers one complete message.
    fn deliver(&self, instance_name: &CStr, status: Status, category: &CStr, message: &CStr);
}

/// Decides which messages are shown.
pub(crate) struct Logger<S> {
    sink: S,
    instance_name: CString,
    enabled: u8,
}

impl<S: Sink> Logger<S> {
    /// Section 2.1.3: errors are always shown, the rest (fmi2Discard too) on demand.
    pub fn new(sink: S, instance_name: &CStr, logging_on: bool) -> Self {
        let mut logger = Self { sink, instance_name: instance_name.to_owned(), enabled: 0 };
        logger.set_all(logging_on);
        logger
    }

    /// `fmi2SetDebugLogging` without a list: everything, or errors only.
    pub fn set_all(&mut self, on: bool) {
        let errors = Category::Error.bit() | Category::Fatal.bit();
        self.enabled = if on { Category::All.bit() } else { errors };
    }

    /// `fmi2SetDebugLogging` with a list: switches just these.
    pub fn set(&mut self, categories: u8, on: bool) {
        if on {
            self.enabled |= categories;
        } else {
            self.enabled &= !categories;
        }
    }

    /// The bit of the category of this name.
    pub fn find(name: &[u8]) -> Option<u8> {
        Category::ALL
            .iter()
            .find(|category| category.name().to_bytes() == name)
            .map(|category| category.bit())
    }

    pub fn log(&self, status: Status, category: Category, message: &str) {
        if self.enabled & category.bit() != 0 {
            self.sink.deliver(&self.instance_name, status, category.name(), &printable(message));
        }
    }
}

/// The text on one line, without what `printf`, FMI (section 2.1.5) or C strings give a meaning to.
fn printable(message: &str) -> CString {
    let special = |c: char| matches!(c, '%' | '#') || c.is_control();
    let safe: String = message.chars().map(|c| if special(c) { '_' } else { c }).collect();
    CString::new(safe).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::printable;

    #[test]
    fn nothing_is_left_that_an_importer_would_expand() {
        assert_eq!(printable("a%s#r1#\0b\nc").to_str(), Ok("a_s_r1__b_c"));
    }
}
