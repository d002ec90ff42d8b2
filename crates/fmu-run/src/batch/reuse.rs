//! Data for reusing the instance of an earlier run.

use crate::pool::{Change, Given};
use crate::system_instance::{Observed, SystemInstance};
use std::time::Duration;

/// How the instance for a run is obtained.
pub(super) enum Choice {
    /// A new instance.
    New,
    /// A reset instance.
    Reset(SystemInstance),
    /// A new instance. The run is also performed in the used instance, to check whether it can be reset.
    Check(SystemInstance, Vec<Change>),
}

/// An instance after a complete run.
pub(super) struct Used {
    pub instance: SystemInstance,
    pub origin: Origin,
    /// Duration of the run.
    pub took: Duration,
}

/// The run that an instance has performed.
pub(super) enum Origin {
    /// A run of an earlier batch, with the values that it set.
    Earlier(Given),
    /// A run of this batch, by its index.
    Run(usize),
}

/// Instance of a thread's previous run, and the state of checks.
#[derive(Default)]
pub(super) struct Reuse {
    pub used: Option<Used>,
    /// Whether enough checks have shown that the FMU can be reset between all runs of this batch.
    pub is_trusted: bool,
    /// Whether the current run only checks the reset, so its results are not returned.
    pub is_check: bool,
    /// Whether all values at the end of a run are read, to compare them.
    pub compares: bool,
    /// The values that were read; `None` if they could not be read.
    pub seen: Option<Observed>,
}

impl Reuse {
    /// Reads all values of an instance, if they are to be compared. Returns false if they cannot be read; then the instance may be
    /// unusable.
    pub fn observe(&mut self, instance: &mut SystemInstance) -> bool {
        if self.compares {
            self.seen = instance.observe().ok();
        }
        !self.compares || self.seen.is_some()
    }
}
