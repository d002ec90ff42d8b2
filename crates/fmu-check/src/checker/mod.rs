//! Executes the call sequences of all checks, evaluates the results and records the findings.

mod evaluation;
mod proofs;
mod records;

use crate::call_sequence::{Action, CallSequence, End, Numbered, Run, Setting, action_name, action_of};
use crate::description::Description;
use crate::finding::Finding;
use crate::legal::first_illegal;
use crate::run::{Stop, Workers};
use crate::worker::interrupted;
use crate::writer::{MAX_READ, Trajectory, Writer, sample};
use fmi_abi::{Causality, Interface, Standard};
pub use records::Unchecked;
use records::record;
use std::collections::HashSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};
use std::time::{Duration, Instant};

/// Maximum duration of a quick check in seconds.
const QUICK: f64 = 30.0;

/// Fraction of the duration that is for the checks. The rest is for shortening and repeating the call sequences of findings.
const CHECKS: f64 = 0.8;

/// Returns the action in which the process of a run ended; `None` if its last action returned.
fn at<'s>(sequence: &'s CallSequence, run: &Run) -> Option<&'s Numbered> {
    action_of(sequence, run.at?)
}

/// State of the check of an FMU.
pub struct Checker {
    pub description: Arc<Description>,
    /// Indices of the variables that most checks read.
    pub readable: Vec<usize>,
    pub setting: Setting,
    pub workers: Workers,
    /// Successful simulation of each interface type that can be checked.
    pub trajectories: Vec<Trajectory>,
    /// Seed of random choices.
    pub seed: u64,
    /// Maximum duration of a call sequence in seconds.
    pub limit: f64,
    /// Instant after which no check starts a call sequence.
    pub deadline: Instant,
    /// Instant at which the check ends, including the repetitions that prove the findings.
    pub end: Instant,
    /// Whether this is a quick check, which tries fewer values and call sequences.
    pub quick: bool,
    found: Mutex<Vec<Finding>>,
    unchecked: Mutex<Vec<Unchecked>>,
    /// Lock that each call sequence holds for reading. A suspected hang is repeated with the lock held for writing, so that no
    /// other call sequence is executed at the same time.
    exclusive: RwLock<()>,
    /// Functions that did not return even when their call sequence was repeated with three times the limit and no other call
    /// sequence was executed at the same time.
    hung: Mutex<HashSet<String>>,
    executed: Mutex<u64>,
    /// Whether the report is final, because the time is over or the user has interrupted the check. Checks that are still running
    /// then have no effect.
    closed: Mutex<bool>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Checker {
    /// Makes a checker without trajectories.
    pub fn new(
        description: Description,
        setting: Setting,
        workers: Workers,
        options: &crate::options::Options,
        begin: Instant,
    ) -> Self {
        let (time, limit) = match options.quick && !options.is_build {
            true => (QUICK, options.limit.min(2.4)),
            false => (options.time.max(1.0), options.limit),
        };
        Self {
            readable: sample(&description, MAX_READ),
            description: Arc::new(description),
            setting,
            workers,
            trajectories: Vec::new(),
            seed: options.seed,
            limit,
            deadline: begin + Duration::from_secs_f64(CHECKS * time),
            end: begin + Duration::from_secs_f64(time),
            quick: options.quick,
            found: Mutex::default(),
            unchecked: Mutex::default(),
            exclusive: RwLock::default(),
            hung: Mutex::default(),
            executed: Mutex::default(),
            closed: Mutex::default(),
        }
    }

    /// Makes the report final.
    pub fn close(&self) {
        *locked(&self.closed) = true;
    }

    /// Returns whether the report is final.
    pub fn is_closed(&self) -> bool {
        *locked(&self.closed)
    }

    /// Writes the report, one thread at a time, unless it is final.
    pub fn unless_closed(&self, write: impl FnOnce() -> anyhow::Result<()>) -> anyhow::Result<()> {
        let closed = locked(&self.closed);
        if *closed { Ok(()) } else { write() }
    }

    pub fn writer<'a>(&'a self, trajectory: &'a Trajectory) -> Writer<'a> {
        Writer::new(&self.description, trajectory, &self.readable)
    }

    /// Returns a call sequence that has only this action.
    pub fn only(&self, action: Action, forbidden: bool) -> CallSequence {
        vec![Numbered { id: 0, forbidden, action }]
    }

    /// Returns an action that reads the FMI version, for which the library must be loaded.
    pub fn version(&self) -> Action {
        Action::Version(if self.fmi3() { "fmi3GetVersion" } else { "fmi2GetVersion" }.to_owned())
    }

    /// Returns `count`, or an eighth of it (rounded up) in a quick check.
    pub fn at_most(&self, count: usize) -> usize {
        if self.quick { count.div_ceil(8) } else { count }
    }

    pub fn fmi3(&self) -> bool {
        self.description.standard == Standard::Fmi3
    }

    /// Returns whether an interface type declares one of these capabilities.
    pub fn can(&self, interface: Interface, names: &[&str]) -> bool {
        self.description.offer(interface).is_some_and(|offer| offer.can(names))
    }

    /// Returns the indices of the readable outputs and continuous states that are numbers.
    pub fn outputs_and_states(&self) -> Vec<usize> {
        let states: HashSet<usize> = self.description.states().into_iter().collect();
        let is_one = |index: &usize| {
            let variable = &self.description.variables[*index];
            variable.is_number()
                && !variable.clocked
                && (variable.causality == Causality::Output || states.contains(index))
        };
        self.readable.iter().copied().filter(is_one).collect()
    }

    /// Returns whether an interface type can save and restore states.
    pub fn saves(&self, interface: Interface) -> bool {
        self.can(interface, &["canGetAndSetFMUstate", "canGetAndSetFMUState"])
    }

    pub fn serializes(&self, interface: Interface) -> bool {
        self.saves(interface) && self.can(interface, &["canSerializeFMUstate", "canSerializeFMUState"])
    }

    /// Returns whether a process may have several instances.
    pub fn several(&self, interface: Interface) -> bool {
        !self.can(interface, &["canBeInstantiatedOnlyOncePerProcess"])
    }

    /// Executes a call sequence with the usual limit.
    pub fn execute(&self, sequence: &CallSequence) -> anyhow::Result<Run> {
        self.execute_for(sequence, self.limit)
    }

    /// Executes a call sequence with a limit in seconds.
    pub fn execute_for(&self, sequence: &CallSequence, limit: f64) -> anyhow::Result<Run> {
        debug_assert_eq!(self.illegal(sequence), None);
        if interrupted() {
            return Err(Stop::Interrupted.into());
        }
        if Instant::now() >= self.deadline {
            return Err(Stop::TimeOver.into());
        }
        let run = {
            let _with_others = self.exclusive.read().unwrap_or_else(PoisonError::into_inner);
            self.execute_until(sequence, limit)?
        };
        // The machine may be busy, so a suspected hang is repeated with no other call sequence at the same time and three times
        // the limit. If the function does not return then either, its next hang is not repeated.
        let name = |run: &Run| {
            at(sequence, run)
                .map_or(String::new(), |at| format!("{}{}", action_name(&at.action), at.forbidden))
        };
        if !matches!(run.end, End::Hang(_)) || locked(&self.hung).contains(&name(&run)) {
            return Ok(run);
        }
        let _exclusive = self.exclusive.write().unwrap_or_else(PoisonError::into_inner);
        let run = self.execute_until(sequence, 3.0 * limit)?;
        if matches!(run.end, End::Hang(_)) {
            locked(&self.hung).insert(name(&run));
        }
        Ok(run)
    }

    /// Executes a call sequence until the limit or the deadline.
    fn execute_until(&self, sequence: &CallSequence, limit: f64) -> anyhow::Result<Run> {
        let remaining = self.deadline.saturating_duration_since(Instant::now()).as_secs_f64();
        *locked(&self.executed) += 1;
        let run = self.workers.execute(&self.setting, sequence, limit.min(remaining.max(0.5)))?;
        match run.end {
            End::Hang(seconds) if seconds < limit => Err(Stop::TimeOver.into()),
            _ => Ok(run),
        }
    }

    /// Describes the first action that the standard does not allow. Only a mistake in fmu-check leads to such an action.
    fn illegal(&self, sequence: &CallSequence) -> Option<String> {
        let id = first_illegal(&self.description, sequence)?;
        Some(format!("{id} {:?}", action_of(sequence, id)?.action))
    }

    /// Returns the number of call sequences that were executed.
    pub fn executed(&self) -> u64 {
        *locked(&self.executed)
    }

    /// Returns the findings so far.
    pub fn findings(&self) -> Vec<Finding> {
        locked(&self.found).clone()
    }

    /// Returns the interfaces and topics that were not checked so far.
    pub fn all_unchecked(&self) -> Vec<Unchecked> {
        locked(&self.unchecked).clone()
    }

    /// Records that an interface or a topic was not checked. If there are several reasons, the first is recorded.
    pub fn unchecked(&self, name: &str, why: String) {
        let mut unchecked = locked(&self.unchecked);
        if !unchecked.iter().any(|known| known.name == name) {
            unchecked.push(Unchecked { name: name.to_owned(), why, allowed: false });
        }
    }

    /// Records the reason why a topic that has begun was not finished.
    pub fn stopped(&self, topic: &str, why: String) {
        let mut unchecked = locked(&self.unchecked);
        if let Some(known) = unchecked.iter_mut().find(|known| known.name == topic) {
            known.why = why;
        }
    }

    /// Removes a topic whose reason is still `unfinished`, because all its checks have ended and none was stopped.
    pub fn finished(&self, topic: &str, unfinished: &str) {
        locked(&self.unchecked).retain(|known| known.name != topic || known.why != unfinished);
    }

    pub fn add(&self, finding: Finding) {
        record(&mut locked(&self.found), finding);
    }

    /// Returns whether there is a finding of this name.
    pub fn has(&self, name: &str) -> bool {
        locked(&self.found).iter().any(|finding| finding.name == name)
    }
}
