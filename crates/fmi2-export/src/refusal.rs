//! Refusals: why a call is answered with another status than fmi2OK.

use crate::model::ModelError;
use crate::types::Status;

/// Why a call was refused.
#[derive(Debug)]
pub(crate) struct Refusal {
    pub status: Status,
    pub message: String,
}

/// A refusal is boxed, so that success is returned in registers.
pub(crate) type Outcome<T = ()> = Result<T, Box<Refusal>>;

/// A refusal with `fmi2Error`.
#[cold]
pub(crate) fn refuse<T>(message: impl Into<String>) -> Outcome<T> {
    Err(Box::new(Refusal { status: Status::Error, message: message.into() }))
}

/// A refusal with `fmi2Error`, for functions that must be fast: nothing of its text is made beside the
/// calls that succeed.
#[cold]
#[inline(never)]
pub(crate) fn refuse_with<T>(message: impl FnOnce() -> String) -> Outcome<T> {
    refuse(message())
}

impl From<ModelError> for Box<Refusal> {
    fn from(error: ModelError) -> Self {
        Self::new(Refusal { status: Status::Error, message: error.to_string() })
    }
}
