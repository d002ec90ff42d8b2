//! Instances and threads that a system reuses in later runs.
//!
//! A reset should make an instance behave like a new one (fmi2Reset, section 2.1.6 of FMI 2.0), but in many FMUs something survives:
//! a parameter, a state, or a value calculated from a parameter. Because a run must not depend on earlier runs, an instance is reused
//! only if creating one takes long, and only after checks. In a check, a reset instance and a new one perform the same run, and all
//! results must be bit-identical. [`Trust`] counts these checks for each [`Change`], for example for each variable whose value
//! differed in the run before the reset.

use crate::error::Error;
use crate::instance::{Instance, Tolerance};
use crate::selection::Target;
use crate::threads::Threads;
use fmi_abi::Value;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Idle instances and threads of a system.
#[derive(Debug, Default)]
pub(crate) struct Pool {
    idle: Mutex<Vec<Idle>>,
    threads: Mutex<Option<Threads>>,
    trust: Mutex<Trust>,
}

/// Instances of all components after a complete run.
#[derive(Debug)]
pub(crate) struct Idle {
    pub components: Vec<Instance>,
    /// Values that the run has set.
    pub given: Given,
    /// Duration of the run.
    pub took: Duration,
}

/// Maximum number of idle entries of a system.
const MOST_IDLE: usize = 256;

impl Pool {
    pub fn take(&self) -> Option<Idle> {
        lock(&self.idle).pop()
    }

    pub fn put(&self, instances: Idle) {
        let mut idle = lock(&self.idle);
        if idle.len() < MOST_IDLE {
            idle.push(instances);
        }
    }

    /// Returns the idle threads if they belong to this process and there are this many, otherwise new ones. The caller returns them
    /// with [`put_threads`](Self::put_threads). Concurrent calls get different threads, so that they do not wait for each other.
    pub fn take_threads(&self, count: usize) -> Result<Threads, Error> {
        let threads = lock(&self.threads).take();
        threads
            .filter(|threads| threads.are_here() && threads.count() == count)
            .map_or_else(|| Threads::new(count), Ok)
    }

    pub fn put_threads(&self, threads: Threads) {
        *lock(&self.threads) = Some(threads);
    }

    pub fn trust(&self) -> MutexGuard<'_, Trust> {
        lock(&self.trust)
    }

    /// Frees all idle instances and threads.
    pub fn clear(&self) {
        let (idle, threads) = (std::mem::take(&mut *lock(&self.idle)), lock(&self.threads).take());
        drop((idle, threads));
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Values that a run sets. Numbers are stored as bits, to compare them exactly.
#[derive(Clone, Debug, Default)]
pub(crate) struct Given {
    /// Start and stop time as bits, and tolerance.
    pub experiment: ([u64; 2], Tolerance),
    pub numbers: Vec<(Target, u64)>,
    pub values: Vec<(Target, Value)>,
    /// Variables that are set during the run, and a hash of their values.
    pub inputs: (Arc<[Target]>, u64),
}

/// A difference between successive runs of an instance, whose effect the reset must remove.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Change {
    /// The instance has performed steps.
    Steps,
    /// Start time, stop time or tolerance differ.
    Experiment,
    /// Values of inputs during the run differ.
    Inputs,
    /// The start value of a variable differs.
    Value(Target),
    /// A variable was set in the run, but is not set in the next one.
    Unset(Target),
}

impl Given {
    /// Returns the differences between this run and the next.
    pub fn changes(&self, next: &Self) -> Vec<Change> {
        let mut changes = vec![Change::Steps];
        if self.experiment != next.experiment {
            changes.push(Change::Experiment);
        }
        add(&mut changes, &self.numbers, &next.numbers, next);
        add(&mut changes, &self.values, &next.values, next);
        if self.inputs != next.inputs {
            changes.push(Change::Inputs);
        }
        changes
            .extend(self.inputs.0.iter().filter(|target| !next.sets(**target)).copied().map(Change::Unset));
        changes
    }

    fn sets(&self, target: Target) -> bool {
        self.inputs.0.contains(&target)
            || self.numbers.iter().any(|(other, _)| *other == target)
            || self.values.iter().any(|(other, _)| *other == target)
    }
}

/// Adds the differences between the start values of two runs.
fn add<T: PartialEq>(changes: &mut Vec<Change>, now: &[(Target, T)], next: &[(Target, T)], all: &Given) {
    for (index, (target, value)) in now.iter().enumerate() {
        // Looks at the same index first, because successive runs usually set the same variables in the same order.
        let same = next.get(index).filter(|(other, _)| other == target);
        match same.or_else(|| next.iter().find(|(other, _)| other == target)) {
            Some((_, other)) if other == value => {}
            None if !all.sets(*target) => changes.push(Change::Unset(*target)),
            _ => changes.push(Change::Value(*target)),
        }
    }
    let is_new = |target: &Target| !now.iter().any(|(other, _)| other == target);
    let new = next.iter().enumerate().filter(|(index, (target, _))| {
        now.get(*index).is_none_or(|(other, _)| other != target) && is_new(target)
    });
    changes.extend(new.map(|(_, (target, _))| Change::Value(*target)));
}

/// Results of the checks of whether an FMU can be reset.
#[derive(Debug, Default)]
pub(crate) struct Trust {
    /// Whether a reset has failed, or something of an earlier run may have survived it.
    forgets: bool,
    /// For each change, the number of checks in which a reset instance behaved like a new one.
    proofs: HashMap<Change, u32>,
    /// Shortest time that the creation of an instance took.
    fastest: Option<Duration>,
    /// Time spent on creating instances, and on checks.
    creating: Duration,
    checking: Duration,
}

impl Trust {
    /// If an instance is created faster than this, each run gets a new one, because no check can prove that a reset removes
    /// everything.
    const LONG: Duration = Duration::from_millis(1);
    /// Number of checks that must include a change. One is not enough, because a value that survives a reset may happen to have no
    /// effect in one run.
    const PROOFS: u32 = 3;

    /// Returns whether instances may be kept: no reset and no check has failed, and creating an instance takes long.
    pub fn may_keep(&self) -> bool {
        !self.forgets && self.fastest.is_some_and(|fastest| fastest >= Self::LONG)
    }

    /// Returns whether enough checks have included each of these changes.
    pub fn proves(&self, changes: impl IntoIterator<Item = Change>) -> bool {
        let is_proven = |change| self.proofs.get(&change).is_some_and(|proofs| *proofs >= Self::PROOFS);
        self.may_keep() && changes.into_iter().all(is_proven)
    }

    /// Returns whether it is time for a check, which takes about as long as a run of this duration. This limits the time spent on
    /// checks to about the time spent on creating instances.
    pub fn is_check_due(&self, run: Duration) -> bool {
        self.may_keep() && self.creating >= self.checking + run
    }

    pub fn created(&mut self, took: Duration) {
        self.creating += took;
        self.fastest = Some(self.fastest.map_or(took, |fastest| fastest.min(took)));
    }

    pub fn checked(&mut self, took: Duration) {
        self.checking += took;
    }

    pub fn prove(&mut self, changes: impl IntoIterator<Item = Change>) {
        changes.into_iter().for_each(|change| *self.proofs.entry(change).or_default() += 1);
    }

    /// Records that the FMU cannot be reset properly. From then on, each run has a new instance.
    pub fn distrust(&mut self) {
        self.forgets = true;
    }
}
