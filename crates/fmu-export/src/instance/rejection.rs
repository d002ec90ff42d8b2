//! The reason why a call returns another status than OK.

use crate::model::Error;
use fmi_abi::Status;

/// Status and message of a rejected call.
#[derive(Debug)]
pub(crate) struct Rejection {
    pub status: Status,
    pub message: String,
}

/// Result of a call. The error is boxed, so that a success is returned in registers.
pub(crate) type Outcome<T = ()> = Result<T, Box<Rejection>>;

/// Returns an error with this message.
#[cold]
pub(crate) fn reject<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(Rejection { status: Status::Error, message: message.into() }))
}

/// Returns an error whose message is built only here, so that the successful path of a fast function contains no code
/// for it.
#[cold]
#[inline(never)]
pub(crate) fn reject_with<T>(message: impl FnOnce() -> String) -> Outcome<T> {
    reject(message())
}

/// Returns the status Discard: the requested information is not available, or a step did not reach its end.
#[cold]
pub(crate) fn discard<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(Rejection { status: Status::Discard, message: message.into() }))
}

impl From<Error> for Box<Rejection> {
    fn from(error: Error) -> Self {
        Self::new(Rejection { status: Status::Error, message: error.to_string() })
    }
}
