//! The categories of log messages.

use crate::status::Status;
use std::ffi::CStr;

/// Category of log messages. The model description lists all categories as `LogCategories` (section 2.2.4 of FMI
/// 2.0).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Category {
    /// Progress of the simulation.
    Events,
    /// A warning.
    Warning,
    /// A status query without a result, or a step that did not reach its end.
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

    /// Returns the name that section 2.2.4 of FMI 2.0 proposes.
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

    /// Returns the sentence that describes the category in the model description.
    pub const fn description(self) -> &'static str {
        match self {
            Self::Events => "Progress of the simulation: instantiation, initialization, reset, termination",
            Self::Warning => "A warning; the simulation continues",
            Self::Discard => "A status query has no result, or a step ended early; the simulation continues",
            Self::Error => "A call was rejected; the message gives the reason",
            Self::Fatal => "The instance failed and can only be freed",
            Self::All => "All categories",
        }
    }

    /// Returns the category of messages with this status.
    pub const fn of(status: Status) -> Self {
        match status {
            Status::Ok | Status::Pending => Self::Events,
            Status::Warning => Self::Warning,
            Status::Discard => Self::Discard,
            Status::Error => Self::Error,
            Status::Fatal => Self::Fatal,
        }
    }
}
