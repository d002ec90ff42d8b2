//! The answer to a call.

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
