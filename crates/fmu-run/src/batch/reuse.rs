//! Instances that are used again, and whether they can be reset.

use crate::kept::{Change, Given};
use crate::running::{Observed, Running};
use std::time::Duration;

/// Instance for a run.
pub(super) enum Choice {
    /// A new instance.
    New,
    /// A reset instance.
    Reset(Running),
    /// A new instance, and the used one to check whether it can be reset.
    Check(Running, Vec<Change>),
}

/// An instance after a complete run.
pub(super) struct Used {
    pub instance: Running,
    pub origin: Origin,
    pub took: Duration,
}

/// The run after which an instance is used again.
pub(super) enum Origin {
    /// A run of an earlier batch.
    Earlier(Given),
    /// A run of this batch, by its number.
    Run(usize),
}

/// Instance of the previous run of a thread, and experience with resets.
#[derive(Default)]
pub(super) struct Reuse {
    pub used: Option<Used>,
    /// Whether the FMU can be reset between all runs of this batch.
    pub is_trusted: bool,
    /// Whether a run is only a check of the reset, which the caller does not observe.
    pub is_check: bool,
    /// Whether all values at the end of a run are compared.
    pub compares: bool,
    /// These values; `None` if they cannot be read.
    pub seen: Option<Observed>,
}

impl Reuse {
    /// Records all values of an instance, if they are compared. Returns whether the instance is usable.
    pub fn observe(&mut self, instance: &mut Running) -> bool {
        if self.compares {
            self.seen = instance.observe().ok();
        }
        !self.compares || self.seen.is_some()
    }
}
