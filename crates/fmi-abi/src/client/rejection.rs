//! Errors of an instance, with the messages of its FMU.

use crate::{Status, shown_number, shown_to};

/// Maximum number of characters of an FMU's message in an error.
const LONGEST: usize = 500;

/// A log message of an FMU.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Status of the message.
    pub status: Status,
    /// Log category; empty if the FMU gives none.
    pub category: String,
    /// Text of the message.
    pub text: String,
}

/// Error of a call: the function, its status, and the messages of the FMU. This crate also creates errors that do not
/// come from the FMU. The content is boxed because every call returns a result, which should be small, and errors are
/// rare.
#[derive(Debug)]
pub struct Rejection(Box<Rejected>);

#[derive(Debug)]
struct Rejected {
    /// Label of the instance, for messages; may be empty.
    label: String,
    function: &'static str,
    status: Status,
    log: Vec<Message>,
    /// Time at which the FMU ended the simulation, s; `None` for any other error.
    ended: Option<f64>,
}

impl Rejection {
    /// Creates an error of a function, with the messages of the FMU.
    #[cold]
    pub fn new(label: &str, function: &'static str, status: Status, log: Vec<Message>) -> Self {
        Self(Box::new(Rejected { label: label.to_owned(), function, status, log, ended: None }))
    }

    /// Creates an error that does not come from an FMU.
    #[cold]
    pub fn without_fmu(function: &'static str, why: &str) -> Self {
        let message = Message { status: Status::Error, category: String::new(), text: why.to_owned() };
        Self::new("", function, Status::Error, vec![message])
    }

    /// Returns the status of the call.
    pub fn status(&self) -> Status {
        self.0.status
    }

    /// Records that the FMU has requested the end of the simulation at this time, s.
    #[must_use]
    pub fn at_end(mut self, time: f64) -> Self {
        self.0.ended = Some(time);
        self
    }

    /// Returns the time at which the FMU ended the simulation, s; `None` for any other error.
    pub fn ended(&self) -> Option<f64> {
        self.0.ended
    }

    /// Returns whether the FMU gave no reason.
    pub fn is_silent(&self) -> bool {
        self.0.log.is_empty() && self.0.ended.is_none()
    }

    /// Returns the message that explains the error, if the FMU logged one.
    pub fn reason(&self) -> Option<&Message> {
        reason(&self.0.log)
    }
}

impl std::fmt::Display for Rejection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Rejected { label, function, status, ended, .. } = &*self.0;
        let text = self.reason().map(|message| shown_to(message.text.trim(), LONGEST));
        let message = text.as_deref().filter(|text| !text.is_empty());
        if !label.is_empty() {
            write!(f, "{label}: ")?;
        }
        if let Some(time) = ended {
            write!(f, "ended by the FMU at t = {} s", shown_number(*time))?;
            return message.map_or(Ok(()), |message| write!(f, ": {message}"));
        }
        match message {
            // Some FMUs include the name of the function in the message.
            Some(message) if message.contains(function) => f.write_str(message),
            Some(message) => write!(f, "{function}: {message}"),
            None => write!(f, "{} returned {:?} without a message", function, status),
        }
    }
}

impl std::error::Error for Rejection {}

/// Returns the message that explains an error: the last one with status Discard or worse, otherwise the last one;
/// `None` if there are no messages.
pub fn reason(log: &[Message]) -> Option<&Message> {
    let is_severe = |of: &&Message| matches!(of.status, Status::Discard | Status::Error | Status::Fatal);
    let severe = log.iter().rev().find(is_severe);
    severe.or(log.last())
}
