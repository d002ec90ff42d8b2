//! Errors: the reason why a call returns another status than OK.

use crate::model::Error;
use fmi_abi::Status;

/// Status and message of a rejected call.
#[derive(Debug)]
pub(crate) struct Refusal {
    pub status: Status,
    pub message: String,
}

/// The error is boxed, so that success is returned in registers.
pub(crate) type Outcome<T = ()> = Result<T, Box<Refusal>>;

/// Returns an error.
#[cold]
pub(crate) fn refuse<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(Refusal { status: Status::Error, message: message.into() }))
}

/// Returns an error, for functions that must be fast: their successful path contains no code for the message.
#[cold]
#[inline(never)]
pub(crate) fn refuse_with<T>(message: impl FnOnce() -> String) -> Outcome<T> {
    refuse(message())
}

/// Returns a discard, for a status that is not available or a step that ended early.
#[cold]
pub(crate) fn discard<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(Refusal { status: Status::Discard, message: message.into() }))
}

impl From<Error> for Box<Refusal> {
    fn from(error: Error) -> Self {
        Self::new(Refusal { status: Status::Error, message: error.to_string() })
    }
}
