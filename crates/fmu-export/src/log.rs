//! Log messages, delivered so that every importer shows them as they are.
//!
//! The callback is variadic and its message a `printf` format, but some importers never expand it and others look
//! for `#r1#` in it. So the text is complete before it is handed over, free of `%` and of `#`, and there are no
//! further arguments.

use crate::model::Model;
use fmi_abi::{Category, Standard, Status};
use std::ffi::{CStr, CString};

const fn bit(category: Category) -> u8 {
    match category {
        Category::All => 0b1_1111,
        other => 1 << other as u8,
    }
}

/// A message on its way to the importer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Message {
    pub status: Status,
    pub text: String,
}

impl Message {
    pub fn category(&self) -> &'static CStr {
        Category::of(self.status).name()
    }

    /// The text on one line, without what `printf`, FMI (section 2.1.5) or C strings give a meaning to.
    pub fn printable(&self) -> CString {
        let special = |c: char| matches!(c, '%' | '#') || c.is_control();
        let safe: String = self.text.chars().map(|c| if special(c) { '_' } else { c }).collect();
        CString::new(safe).unwrap_or_default()
    }
}

/// A model's messages to the user. A field of the model; [`Model::log`](crate::Model::log) hands it out, and what is
/// in it is delivered at the end of the call, `%`, `#` and control characters as `_`: importers give them a meaning.
///
/// ```
/// # let mut log = fmu_export::Log::default();
/// log.warning("the valve is nearly closed: pressures are less exact");
/// ```
#[derive(Debug, Default)]
pub struct Log(Vec<Message>);

impl Log {
    /// Says what happens, to who follows the course of the simulation (`logEvents`).
    pub fn event(&mut self, text: impl Into<String>) {
        self.0.push(Message { status: Status::Ok, text: text.into() });
    }

    /// Says that something is odd, while the simulation goes on (`logStatusWarning`).
    pub fn warning(&mut self, text: impl Into<String>) {
        self.0.push(Message { status: Status::Warning, text: text.into() });
    }

    /// Whether nothing is waiting.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// A copy of a model has nothing to say yet.
impl Clone for Log {
    fn clone(&self) -> Self {
        Self::default()
    }

    fn clone_from(&mut self, _: &Self) {}
}

/// Decides which messages are shown, and keeps them until the call has ended.
#[derive(Debug)]
pub(crate) struct Logger {
    enabled: u8,
    /// What is shown where nothing else is said.
    always: u8,
    /// What nobody can switch off: errors in FMI 3.0 (section 2.3.1), nothing in FMI 2.0.
    fixed: u8,
    waiting: Vec<Message>,
}

impl Logger {
    /// Errors are always shown, the rest on demand (section 2.1.3 of FMI 2.0, 2.3.1 of FMI 3.0). Warnings are in FMI
    /// 2.0 only; a discard there has other ways to tell its reason, in FMI 3.0 it is like an error for most importers.
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

    /// Without a list: everything, or what is always shown.
    pub fn set_all(&mut self, on: bool) {
        self.enabled = if on { bit(Category::All) } else { self.always };
    }

    /// With a list: switches just these.
    pub fn set(&mut self, categories: u8, on: bool) {
        if on {
            self.enabled |= categories;
        } else {
            self.enabled &= !categories | self.fixed;
        }
    }

    /// The bit of the category of this name.
    pub fn find(name: &[u8]) -> Option<u8> {
        let mut known = Category::ALL.iter();
        known.find(|category| category.name().to_bytes() == name).map(|category| bit(*category))
    }

    #[cold]
    pub fn log(&mut self, status: Status, text: impl Into<String>) {
        self.add(Message { status, text: text.into() });
    }

    #[cold]
    pub fn add(&mut self, message: Message) {
        if self.enabled & bit(Category::of(message.status)) != 0 {
            self.waiting.push(message);
        }
    }

    /// Takes over what a model has to say. Returns whether it said anything.
    #[inline]
    pub fn listen(&mut self, model: &mut impl Model) -> bool {
        let Some(log) = model.log().filter(|log| !log.is_empty()) else { return false };
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
    fn nothing_is_left_that_an_importer_would_expand() {
        let message = Message { status: Status::Ok, text: "a%s#r1#\0b\nc".to_owned() };
        assert_eq!(message.printable().to_str(), Ok("a_s_r1__b_c"));
    }
}
