//! Refusals: why a call is answered with another status than OK.

use crate::model::Error;
use fmi_abi::Status;

/// Why a call was refused.
#[derive(Debug)]
pub(crate) struct Refusal {
    pub status: Status,
    pub message: String,
}

/// A refusal is boxed, so that success is returned in registers.
pub(crate) type Outcome<T = ()> = Result<T, Box<Refusal>>;

/// A refusal as an error.
#[cold]
pub(crate) fn refuse<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(Refusal { status: Status::Error, message: message.into() }))
}

/// A refusal as an error, for functions that must be fast: nothing of its text is made beside the calls that
/// succeed.
#[cold]
#[inline(never)]
pub(crate) fn refuse_with<T>(message: impl FnOnce() -> String) -> Outcome<T> {
    refuse(message())
}

/// A question without an answer, or a step that ended early.
#[cold]
pub(crate) fn discard<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(Refusal { status: Status::Discard, message: message.into() }))
}

impl From<Error> for Box<Refusal> {
    fn from(error: Error) -> Self {
        Self::new(Refusal { status: Status::Error, message: error.to_string() })
    }
}
