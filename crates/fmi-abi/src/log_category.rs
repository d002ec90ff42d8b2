//! The categories of log messages.

use crate::status::Status;
use std::ffi::CStr;

/// Log category; the model description lists them as `LogCategories` (section 2.2.4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Category {
    /// Progress of the simulation.
    Events,
    /// A warning.
    Warning,
    /// A status query without a result, or a step that ended early.
    Discard,
    /// A rejected call.
    Error,
    /// A failure after which the instance cannot be used.
    Fatal,
    /// Every category.
    All,
}

impl Category {
    /// All categories, for the model description.
    pub const ALL: [Self; 6] =
        [Self::Events, Self::Warning, Self::Discard, Self::Error, Self::Fatal, Self::All];

    /// Returns the name that section 2.2.4 proposes.
    pub const fn name(self) -> &'static CStr {
        match self {
            Self::Events => c"logEvents",
            Self::Warning => c"logStatusWarning",
            Self::Discard => c"logStatusDiscard",
            Self::Error => c"logStatusError",
            Self::Fatal => c"logStatusFatal",
            Self::All => c"logAll",
        }
    }

    /// Returns a sentence for the model description.
    pub const fn description(self) -> &'static str {
        match self {
            Self::Events => "The course of the simulation: instantiation, initialization, reset, termination",
            Self::Warning => "Something is odd; the simulation goes on",
            Self::Discard => "A question about the step has no answer; the simulation goes on",
            Self::Error => "A call was refused; the message says why and what to do",
            Self::Fatal => "The instance is broken and can only be freed",
            Self::All => "All of the above",
        }
    }

    /// Returns the category of messages with this status.
    pub const fn of(status: Status) -> Self {
        match status {
            Status::Ok => Self::Events,
            Status::Warning => Self::Warning,
            Status::Discard => Self::Discard,
            Status::Error => Self::Error,
            Status::Fatal => Self::Fatal,
        }
    }
}
