//! Status of a call.

use crate::c_types::c_int;

/// Status that a call returns (section 2.1.3 of FMI 2.0).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub enum Status {
    /// The call succeeded.
    Ok = 0,
    /// A warning; the computation can continue. fmu-export reports warnings only in the log, because some
    /// importers stop on this status.
    Warning = 1,
    /// The requested information is not available, or a calculation failed that may succeed with a smaller step.
    Discard = 2,
    /// The call was rejected.
    Error = 3,
    /// The instance cannot be used any more.
    Fatal = 4,
    /// A step is performed asynchronously (FMI 2.0). No function of fmu-export returns it.
    Pending = 5,
}

impl Status {
    /// Converts the status of a third-party library. An unknown value becomes `Error`.
    #[inline]
    pub const fn from_c(code: c_int) -> Self {
        match code {
            0 => Self::Ok,
            1 => Self::Warning,
            2 => Self::Discard,
            4 => Self::Fatal,
            5 => Self::Pending,
            _ => Self::Error,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Status;

    #[test]
    fn other_numbers_are_errors() {
        let known =
            [Status::Ok, Status::Warning, Status::Discard, Status::Error, Status::Fatal, Status::Pending];
        assert_eq!([0, 1, 2, 3, 4, 5].map(Status::from_c), known);
        assert_eq!([-1, 6].map(Status::from_c), [Status::Error; 2]);
    }
}
