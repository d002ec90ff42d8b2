//! Log messages, in a form that every importer shows unchanged.
//!
//! In FMI 2.0, the log callback is variadic and its message is a `printf` format. Some importers never expand the
//! format, and others replace value references such as `#r1#` in it. So each message is complete, contains neither
//! `%` nor `#`, and is passed without further arguments.

use fmi_abi::{Category, Standard, Status};
use std::ffi::{CStr, CString};

const fn bit(category: Category) -> u8 {
    match category {
        Category::All => 0b1_1111,
        other => 1 << other as u8,
    }
}

/// A message for the importer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Message {
    pub status: Status,
    pub message: String,
}

impl Message {
    pub fn category(&self) -> &'static CStr {
        Category::of(self.status).name()
    }

    /// Returns the message on one line. Control characters, and characters that `printf` or FMI (section 2.1.5 of FMI
    /// 2.0) would interpret, are replaced by `_`.
    pub fn printable(&self) -> CString {
        let special = |c: char| matches!(c, '%' | '#') || c.is_control();
        let safe: String = self.message.chars().map(|c| if special(c) { '_' } else { c }).collect();
        CString::new(safe).unwrap_or_default()
    }
}

/// Messages of a model to the user. The log is a field of the model, and [`Model::log`](crate::Model::log) returns a
/// reference to it. At the end of each call of the importer, this crate delivers the messages whose category is
/// enabled. It replaces `%`, `#` and control characters by `_`, because importers would interpret them.
///
/// ```
/// # let mut log = fmu_export::Log::default();
/// log.warning("the valve is nearly closed: pressures are less exact");
/// ```
#[derive(Debug, Default)]
pub struct Log(Vec<Message>);

impl Log {
    /// Logs an event of the simulation (`logEvents`).
    pub fn event(&mut self, message: impl Into<String>) {
        self.0.push(Message { status: Status::Ok, message: message.into() });
    }

    /// Logs a warning; the simulation continues (`logStatusWarning`).
    pub fn warning(&mut self, message: impl Into<String>) {
        self.0.push(Message { status: Status::Warning, message: message.into() });
    }

    /// Returns whether no message is waiting.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// A copy of a log is empty, so that no message is delivered twice.
impl Clone for Log {
    fn clone(&self) -> Self {
        Self::default()
    }

    fn clone_from(&mut self, _: &Self) {}
}

/// Filters messages by category, and stores them until the end of the call.
#[derive(Debug)]
pub(crate) struct Logger {
    enabled: u8,
    /// Categories that are enabled by default.
    always: u8,
    /// Categories that cannot be disabled: errors in FMI 3.0 (section 2.3.1), none in FMI 2.0.
    fixed: u8,
    waiting: Vec<Message>,
}

impl Logger {
    /// Enables all categories if `logging_on` is true (section 2.1.5 of FMI 2.0, 2.3.1 of FMI 3.0). Otherwise enables
    /// errors and, in FMI 2.0, warnings. In FMI 3.0 it enables discards instead of warnings, because most importers
    /// treat a discard like an error.
    pub fn new(standard: Standard, logging_on: bool) -> Self {
        let errors = bit(Category::Error) | bit(Category::Fatal);
        let (always, fixed) = match standard {
            Standard::Fmi2 => (errors | bit(Category::Warning), 0),
            Standard::Fmi3 => (errors | bit(Category::Discard), errors),
        };
        let mut logger = Self { enabled: 0, always, fixed, waiting: Vec::new() };
        logger.set_all(logging_on);
        logger
    }

    /// Enables all categories, or restores the default. The importer requests this by a call without a list of
    /// categories.
    pub fn set_all(&mut self, on: bool) {
        self.enabled = if on { bit(Category::All) } else { self.always };
    }

    /// Enables or disables these categories; categories that cannot be disabled stay enabled. The importer requests
    /// this by a call with a list of categories.
    pub fn set(&mut self, categories: u8, on: bool) {
        if on {
            self.enabled |= categories;
        } else {
            self.enabled &= !categories | self.fixed;
        }
    }

    /// Returns the bit of the category with this name; for `logAll`, the bits of all categories.
    pub fn find(name: &[u8]) -> Option<u8> {
        let mut known = Category::ALL.iter();
        known.find(|category| category.name().to_bytes() == name).map(|category| bit(*category))
    }

    #[cold]
    pub fn log(&mut self, status: Status, message: impl Into<String>) {
        self.add(Message { status, message: message.into() });
    }

    #[cold]
    pub fn add(&mut self, message: Message) {
        if self.enabled & bit(Category::of(message.status)) != 0 {
            self.waiting.push(message);
        }
    }

    /// Takes the messages from the log of a model. Returns whether there were any.
    #[inline]
    pub fn listen(&mut self, log: Option<&mut Log>) -> bool {
        let Some(log) = log.filter(|log| !log.is_empty()) else { return false };
        std::mem::take(&mut log.0).into_iter().for_each(|message| self.add(message));
        true
    }

    #[inline]
    pub fn is_empty(&self) -> bool {
        self.waiting.is_empty()
    }

    pub fn take(&mut self) -> Vec<Message> {
        std::mem::take(&mut self.waiting)
    }
}

#[cfg(test)]
mod tests {
    use super::Message;
    use fmi_abi::Status;

    #[test]
    fn characters_that_an_importer_would_expand_are_replaced() {
        let message = Message { status: Status::Ok, message: "a%s#r1#\0b\nc".to_owned() };
        assert_eq!(message.printable().to_str(), Ok("a_s_r1__b_c"));
    }
}
