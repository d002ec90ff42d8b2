//! Errors: the reason why a call returns another status than OK.

use crate::model::Error;
use fmi_abi::Status;

/// Status and message of a rejected call.
#[derive(Debug)]
pub(crate) struct Rejection {
    pub status: Status,
    pub message: String,
}

/// The error is boxed, so that success is returned in registers.
pub(crate) type Outcome<T = ()> = Result<T, Box<Rejection>>;

/// Returns an error.
#[cold]
pub(crate) fn reject<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(Rejection { status: Status::Error, message: message.into() }))
}

/// Returns an error, for functions that must be fast: their successful path contains no code for the message.
#[cold]
#[inline(never)]
pub(crate) fn reject_with<T>(message: impl FnOnce() -> String) -> Outcome<T> {
    reject(message())
}

/// Returns a discard, for a status that is not available or a step that ended early.
#[cold]
pub(crate) fn discard<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(Rejection { status: Status::Discard, message: message.into() }))
}

impl From<Error> for Box<Rejection> {
    fn from(error: Error) -> Self {
        Self::new(Rejection { status: Status::Error, message: error.to_string() })
    }
}
