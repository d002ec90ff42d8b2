//! The answer to a call.

use crate::c_types::c_int;

/// What a call answers (section 2.1.3).
///
/// `Pending` is missing on purpose: no function here works asynchronously.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum Status {
    /// All well.
    Ok = 0,
    /// Something is odd, but the computation can continue. Some importers stop on it: it is said in the log only.
    Warning = 1,
    /// The information or the step cannot be had.
    Discard = 2,
    /// The call was refused.
    Error = 3,
    /// The instance is broken for good.
    Fatal = 4,
}

impl Status {
    /// The answer of a library that may be anybody's: what is no status is an error, and so is `Pending`, where nothing waits
    /// for steps.
    #[inline]
    pub const fn from_c(code: c_int) -> Self {
        match code {
            0 => Self::Ok,
            1 => Self::Warning,
            2 => Self::Discard,
            4 => Self::Fatal,
            _ => Self::Error,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Status;

    #[test]
    fn other_numbers_and_pending_are_errors() {
        let known = [Status::Ok, Status::Warning, Status::Discard, Status::Error, Status::Fatal];
        assert_eq!([0, 1, 2, 3, 4].map(Status::from_c), known);
        assert_eq!([-1, 5, 6].map(Status::from_c), [Status::Error; 3]);
    }
}
