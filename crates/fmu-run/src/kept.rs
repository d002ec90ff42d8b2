//! Instances and threads that a system keeps from one run to the next.
//!
//! An instance that was reset should behave like a new one (fmi2Reset, section 2.1.6 of FMI 2.0), but in many
//! FMUs something survives: a parameter, a state, or a value calculated from a parameter. A run must not
//! depend on earlier runs, so an instance is used again only if a new one takes long, and only after checks: the same run in a reset
//! instance and in a new one gives the same bits. [`Trust`] counts the checks for each variable whose value differed before the reset.

use crate::error::Error;
use crate::instance::{Instance, Tolerance};
use crate::selection::Target;
use crate::threads::Threads;
use fmi_abi::Value;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Instances and threads without work.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    idle: Mutex<Vec<Idle>>,
    threads: Mutex<Option<Threads>>,
    trust: Mutex<Trust>,
}

/// Instances of all components after a complete run.
#[derive(Debug)]
pub(crate) struct Idle {
    pub components: Vec<Instance>,
    /// Values that were set in the run.
    pub given: Given,
    /// Duration of the run.
    pub took: Duration,
}

/// Maximum number of idle instances of a system.
const MOST_IDLE: usize = 256;

impl Kept {
    pub fn take(&self) -> Option<Idle> {
        lock(&self.idle).pop()
    }

    pub fn put(&self, instances: Idle) {
        let mut idle = lock(&self.idle);
        if idle.len() < MOST_IDLE {
            idle.push(instances);
        }
    }

    /// Returns idle threads if there are this many, otherwise new ones. [`put_threads`](Self::put_threads) keeps them; calls at the
    /// same time have different threads, so that they do not wait for each other.
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

/// Values that a run sets, by their bits.
#[derive(Clone, Debug, Default)]
pub(crate) struct Given {
    /// Start and stop time, and tolerance.
    pub experiment: ([u64; 2], Tolerance),
    pub numbers: Vec<(Target, u64)>,
    pub values: Vec<(Target, Value)>,
    /// Variables that are set at each time, and a hash of their values.
    pub inputs: (Arc<[Target]>, u64),
}

/// A difference between successive runs of an instance, which the reset has to remove.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Change {
    /// The instance was stepped.
    Steps,
    /// Start time, stop time or tolerance differ.
    Experiment,
    /// Values of inputs during the run differ.
    Inputs,
    /// The start value of a variable differs.
    Value(Target),
    /// A variable was set, and is not set in the next run.
    Unset(Target),
}

impl Given {
    /// Returns the changes from this run to the next.
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

fn add<T: PartialEq>(changes: &mut Vec<Change>, now: &[(Target, T)], next: &[(Target, T)], all: &Given) {
    for (index, (target, value)) in now.iter().enumerate() {
        // Usually, both runs set the same variables in the same order.
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

/// Experience with resets of an FMU.
#[derive(Debug, Default)]
pub(crate) struct Trust {
    /// Whether a reset failed, or left something of the earlier run.
    forgets: bool,
    /// Number of checks by change in which a reset instance behaved like a new one.
    proofs: HashMap<Change, u32>,
    /// Shortest time that a new instance took.
    fastest: Option<Duration>,
    /// Time spent on new instances and on checks.
    creating: Duration,
    checking: Duration,
}

impl Trust {
    /// Time below which a new instance is made for each run, because no check can prove that a reset forgets nothing.
    const LONG: Duration = Duration::from_millis(1);
    /// Number of checks in which a change has to occur. The values of one run may hide what a reset forgets.
    const PROOFS: u32 = 3;

    /// Returns whether an instance is worth keeping.
    pub fn may_keep(&self) -> bool {
        !self.forgets && self.fastest.is_some_and(|fastest| fastest >= Self::LONG)
    }

    pub fn proves(&self, changes: impl IntoIterator<Item = Change>) -> bool {
        let is_proven = |change| self.proofs.get(&change).is_some_and(|proofs| *proofs >= Self::PROOFS);
        self.may_keep() && changes.into_iter().all(is_proven)
    }

    /// Returns whether a check, which takes as long as a run, is worthwhile. So at most as much time is spent on checks as on new
    /// instances.
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
