//! Executes the call sequences of all checks, evaluates the results and records the findings.

use crate::always;
use crate::call_sequence::{CallSequence, End, Numbered, Run, Setting, Step, step_of};
use crate::description::Description;
use crate::finding::{Criterion, Event, Finding, Proof, Severity, SharedCriterion, ending, event, step_name};
use crate::legal::first_illegal;
use crate::reproduce::confirm::Proving;
use crate::rules;
use crate::run::{Stop, Workers};
use crate::shrink::shrink;
use crate::worker::interrupted;
use crate::writer::{READ, Read, Trajectory, Writer, difference, sample};
use fmi_abi::{Interface, Standard};
use std::collections::HashSet;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};
use std::time::{Duration, Instant};

/// Interface or topic that was not checked.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Unchecked {
    /// Name of the interface or topic.
    pub name: String,
    /// Reason for which it was not checked.
    pub why: String,
    /// Whether an option or the baseline allows it.
    pub allowed: bool,
}

/// Duration of a quick check in seconds.
const QUICK: f64 = 30.0;

/// Part of the duration for the checks. The rest is for shortening call sequences and for the programs that reproduce the findings.
const CHECKS: f64 = 0.8;

/// Functions for each topic whose calls are never removed from a call sequence. If one of two compared simulations lacked such
/// a call, the results would differ for that reason.
const PINNED: &[(&str, &[&str])] = &[
    ("states", STATES),
    ("reset", STATES),
    ("derivatives", &["SetReal", "SetFloat64", "SetContinuousStates"]),
    ("results", STEPS),
    ("life_cycle", STEPS),
    ("dynamics", DYNAMICS),
];
#[rustfmt::skip]
const DYNAMICS: &[&str] = &[
    "SetTime", "DoStep", "CompletedIntegratorStep", "SetContinuousStates", "SetReal", "SetFloat64", "SetFloat32", "EnterEventMode",
    "EnterInitializationMode",
];
#[rustfmt::skip]
const STATES: &[&str] = &[
    "Reset", "GetFMUState", "SetFMUState", "FreeFMUState", "SerializedFMUStateSize", "SerializeFMUState",
    "DeserializeFMUState", "EnterInitializationMode",
];
const STEPS: &[&str] = &["SetTime", "DoStep", "CompletedIntegratorStep"];

/// Findings whose criterion compares no calls, so calls are removed separately.
#[rustfmt::skip]
const REMOVED_SEPARATELY: [&str; 5] = [
    "life_cycle.rejected", "life_cycle.states-changed", "results.early-return", "results.early-unreported", "start_values.inputs",
];

/// Pseudorandom number generator.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 33) as usize % end
    }
}

/// Returns the step in which a process ended before the last step.
fn at<'s>(sequence: &'s CallSequence, run: &Run) -> Option<&'s Numbered> {
    step_of(sequence, run.at?)
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
    /// Instant at which the check ends.
    pub end: Instant,
    /// Whether fewer values and call sequences are tried.
    pub quick: bool,
    found: Mutex<Vec<Finding>>,
    unchecked: Mutex<Vec<Unchecked>>,
    /// Lock that each call sequence holds for reading. A suspected hang is repeated with the lock held for writing, so that no
    /// other call sequence is executed at the same time.
    exclusive: RwLock<()>,
    /// Functions that did not return in a repetition with three times the limit and no other call sequence.
    hung: Mutex<HashSet<String>>,
    executed: Mutex<u64>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Records a finding. Of several with one name, the most severe is kept, and of these the one with the shortest call sequence.
/// Its field `more` lists the other observations.
fn record(found: &mut Vec<Finding>, mut finding: Finding) {
    let Some(kept) = found.iter_mut().find(|kept| kept.name == finding.name) else {
        found.push(finding);
        return;
    };
    let rank = |finding: &Finding| (finding.severity, std::cmp::Reverse(finding.sequence.len()));
    if rank(&finding) > rank(kept) {
        std::mem::swap(kept, &mut finding);
    }
    for observed in std::iter::once(finding.observed).chain(finding.more) {
        if observed != kept.observed && !kept.more.contains(&observed) {
            kept.more.push(observed);
        }
    }
}

/// Returns an observation without its numbers, to compare observations of one finding.
fn outline(observed: &str) -> String {
    let names = observed.split(|letter: char| !(letter.is_alphabetic() || letter == '_'));
    names.filter(|name| name.len() > 1 && !["NaN", "inf"].contains(name)).collect::<Vec<_>>().join(" ")
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
        let time = if options.quick { QUICK } else { options.time.max(1.0) };
        let limit = if options.quick { options.limit.min(2.4) } else { options.limit };
        Self {
            readable: sample(&description, READ),
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
        }
    }

    pub fn writer<'a>(&'a self, trajectory: &'a Trajectory) -> Writer<'a> {
        Writer::new(&self.description, trajectory, &self.readable)
    }

    pub fn step(&self, step: Step, forbidden: bool) -> CallSequence {
        vec![Numbered { id: 0, forbidden, step }]
    }

    /// Returns a step that calls the function for the version, which loads the library.
    pub fn version(&self) -> Step {
        Step::Version(if self.fmi3() { "fmi3GetVersion" } else { "fmi2GetVersion" }.to_owned())
    }

    /// Returns `count`, or an eighth of it in a quick check.
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
                && (variable.causality == "output" || states.contains(index))
        };
        self.readable.iter().copied().filter(is_one).collect()
    }

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
            at(sequence, run).map_or(String::new(), |at| format!("{}{}", step_name(&at.step), at.forbidden))
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

    /// Returns the first step that the standard does not allow, which is an error in fmu-check.
    fn illegal(&self, sequence: &CallSequence) -> Option<String> {
        let id = first_illegal(&self.description, sequence)?;
        Some(format!("{id} {:?}", step_of(sequence, id)?.step))
    }

    pub fn executed(&self) -> u64 {
        *locked(&self.executed)
    }

    /// Returns the findings so far.
    pub fn findings(&self) -> Vec<Finding> {
        locked(&self.found).clone()
    }

    /// Returns what was not checked so far.
    pub fn all_unchecked(&self) -> Vec<Unchecked> {
        locked(&self.unchecked).clone()
    }

    /// Records an interface or a topic that was not checked, with the first reason.
    pub fn unchecked(&self, name: &str, why: String) {
        let mut unchecked = locked(&self.unchecked);
        if !unchecked.iter().any(|known| known.name == name) {
            unchecked.push(Unchecked { name: name.to_owned(), why, allowed: false });
        }
    }

    /// Records the reason for which a topic that has begun was not finished.
    pub fn stopped(&self, topic: &str, why: String) {
        let mut unchecked = locked(&self.unchecked);
        if let Some(known) = unchecked.iter_mut().find(|known| known.name == topic) {
            known.why = why;
        }
    }

    /// Records that all checks of a topic have ended, unless one of them was stopped.
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

    /// Records a finding if a run breaks a rule; returns whether it does.
    pub fn record(&self, name: &str, run: &Run, sequence: &CallSequence, criterion: impl Criterion) -> bool {
        let observed = if run.end == End::Done { criterion(run) } else { None };
        let found = observed.map(|observed| {
            self.add(self.broken(name, observed).shown_by(sequence.clone(), Arc::new(criterion)))
        });
        found.is_some()
    }

    /// Returns the finding that the FMU breaks a rule.
    pub fn broken(&self, name: &str, observed: String) -> Finding {
        rules::broken(self.description.standard, name, observed)
    }

    /// Records the findings of the rules that hold for every run.
    pub fn record_always(&self, sequence: &CallSequence, run: &Run) {
        always::findings(&self.description, sequence, run).into_iter().for_each(|finding| self.add(finding));
    }

    /// Executes a call sequence and records its findings: the end of the process or, if the last step returned, the violations
    /// of `criterion` and of the rules that hold for every run.
    pub fn evaluate(
        &self,
        name: &str,
        sequence: CallSequence,
        criterion: impl Criterion,
    ) -> anyhow::Result<Run> {
        let forbidden = sequence.iter().any(|numbered| numbered.forbidden);
        let limit = if forbidden { self.limit.min(3.0) } else { self.limit };
        let run = self.execute_for(&sequence, limit)?;
        if run.end != End::Done {
            self.ended(name, &sequence, &run, forbidden)?;
            return Ok(run);
        }
        self.record_always(&sequence, &run);
        self.record(name, &run, &sequence, criterion);
        Ok(run)
    }

    /// Executes a call sequence and records its findings, as `evaluate` does.
    pub fn check(&self, name: &str, sequence: CallSequence, criterion: impl Criterion) -> anyhow::Result<()> {
        self.evaluate(name, sequence, criterion).map(|_| ())
    }

    /// Returns the criterion that reads are equal. The message has `{}` for the variable, its value and the other value.
    pub fn differ(&self, one: &[Read], other: &[Read], message: &'static str) -> Box<dyn Criterion> {
        self.differ_by(0.0, one, other, message)
    }

    fn differ_by(
        &self,
        tolerance: f64,
        one: &[Read],
        other: &[Read],
        message: &'static str,
    ) -> Box<dyn Criterion> {
        let (description, one, other) = (self.description.clone(), one.to_vec(), other.to_vec());
        Box::new(move |run: &Run| {
            let found = difference(&description, run, &one, &other, tolerance)?;
            let values = found.into_iter().chain([String::new()]);
            Some(message.split("{}").zip(values).map(|(text, value)| text.to_owned() + &value).collect())
        })
    }

    /// Returns the criterion that reads are equal within 20 times the tolerance of the default experiment. A solver with variable steps
    /// that continues from a restored state may differ by more than the tolerance, because the tolerance limits the error of a single step,
    /// while the errors of several steps add up and derivatives amplify them.
    pub fn continued(&self, one: &[Read], other: &[Read], message: &'static str) -> Box<dyn Criterion> {
        self.differ_by(20.0 * self.description.tolerance(), one, other, message)
    }

    /// Returns the reason for which this machine cannot load the library, if other machines can: a shared library that the FMU does
    /// not contain, or a newer version of a system library, is missing.
    pub fn lacks(&self, run: &Run) -> Option<String> {
        let End::Unloadable(why) = &run.end else { return None };
        let missing = why.split_once(": cannot open shared object file").map(|(name, _)| name.trim());
        let missing = missing.map(|name| name.rsplit_once(": ").map_or(name, |(_, name)| name));
        let directory = self.setting.libraries.iter().flatten().find_map(|library| library.parent());
        // An FMU that contains the missing library does not find it on any machine.
        let is_missing = |name: &&str| {
            directory.is_some_and(|directory| !directory.join(name).exists() && !name.contains('/'))
        };
        let old = ["`GLIBC_", "`GLIBCXX_", "`CXXABI_", "`GCC_"].iter().any(|version| why.contains(version));
        match missing.filter(is_missing) {
            Some(name) => Some(format!("this machine lacks {name}, which the library needs")),
            None => old.then(|| format!("a system library of this machine is too old: {why}")),
        }
    }

    /// Records the finding of a run that ended before its last step.
    fn ended(&self, rule: &str, sequence: &CallSequence, run: &Run, forbidden: bool) -> anyhow::Result<()> {
        let Some(observed) = ending(run, sequence) else { return Ok(()) };
        if self.lacks(run).is_some() {
            return Ok(());
        }
        let ends: SharedCriterion = {
            let (sequence, kind) = (sequence.clone(), std::mem::discriminant(&run.end));
            let name_at =
                |run: &Run, sequence: &CallSequence| at(sequence, run).map(|at| step_name(&at.step));
            let at = name_at(run, &sequence);
            let floods = matches!(run.end, End::Flood(_));
            Arc::new(move |run: &Run| {
                // How many processes are alive at a time depends on the scheduler.
                if floods && !run.orphans.is_empty() {
                    return Some(format!(
                        "{} processes are alive after the call sequence",
                        run.orphans.len()
                    ));
                }
                let same = std::mem::discriminant(&run.end) == kind && name_at(run, &sequence) == at;
                same.then(|| ending(run, &sequence))?
            })
        };
        let record = |name: &str, observed: String| {
            let mut ended = self.broken(name, observed).shown_by(sequence.clone(), Arc::clone(&ends));
            if forbidden {
                ended.severity = ended.severity.max(Severity::Fragile);
            }
            self.add(ended);
            Ok(())
        };
        // A repetition with accessible memory after each array reveals an access beyond an array.
        if matches!(run.end, End::Crash(_)) && cfg!(unix) && !forbidden {
            let soft = Setting { soft: true, ..self.setting.clone() };
            let again = self.workers.execute(&soft, sequence, self.limit)?;
            if again.outcomes.values().any(|outcome| !outcome.damage.is_empty()) {
                return record("arrays.written-beyond", format!("{observed}: it writes beyond an array"));
            }
            if again.end == End::Done {
                let how = "it reads beyond an array, or memory that was freed";
                return record("arrays.read-beyond", format!("{observed}: {how}"));
            }
        }
        let what = match run.end {
            End::Unloadable(_) => return record("package.unloadable", observed),
            End::Flood(_) => return record("resources.processes", observed),
            End::Hang(_) => "hang",
            End::Exit(_) => "exit",
            _ => "crash",
        };
        // An end that only this call sequence can reach is named after its rule, any other after the topic.
        let own = ["fresh-process", "unload", "exit", "location"].iter().any(|name| rule.ends_with(name));
        let name = match rule.split_once('.') {
            Some((topic, _)) if !own && (!forbidden || topic == "rejections") => topic,
            _ => rule,
        };
        record(&format!("{name}.{what}"), observed)
    }

    /// Returns the result of a successful update of the discrete states.
    pub fn event(&self, run: &Run, id: u32) -> Option<Event> {
        event(run, id, self.fmi3())
    }

    /// Returns the setting that reproduces a finding. For a crash or an access beyond an array, arrays end at a guard page.
    fn hard(&self, finding: &Finding) -> Setting {
        let ends = ["read-beyond", "written-beyond", "crash"].iter().any(|end| finding.name.ends_with(end));
        Setting { soft: self.setting.soft && !ends, ..self.setting.clone() }
    }

    /// Shortens the call sequence of a finding, writes the program that reproduces it, and runs the program. A finding that the program
    /// does not show becomes a note. Ends at the instant `until`.
    pub fn prove(&self, finding: &mut Finding, scratch: &Path, shortens: bool, until: Instant) {
        if finding.criterion.is_none() {
            return;
        }
        let begin = Instant::now();
        let (sequence, observed) = (finding.sequence.clone(), finding.observed.clone());
        if shortens {
            self.shorten(finding, begin + until.saturating_duration_since(begin) / 2);
        }
        let mut proof = self.proof(finding, scratch, until);
        // A call that was removed may be necessary in another process.
        if matches!(proof, Proof::NotShown(_)) && finding.sequence.len() < sequence.len() {
            finding.steps.1 = sequence.len();
            (finding.sequence, finding.observed) = (sequence, observed);
            proof = self.proof(finding, scratch, until);
        }
        finding.judge(proof);
    }

    /// Writes the program of a finding, and runs it.
    fn proof(&self, finding: &mut Finding, scratch: &Path, until: Instant) -> Proof {
        let over =
            |_| Proof::NotRun(if interrupted() { Stop::Interrupted } else { Stop::TimeOver }.to_string());
        match self.reproduce(finding, until) {
            Ok(true) => {}
            Ok(false) => return Proof::NotShown("a repetition of its calls does not show it".to_owned()),
            Err(error) => return over(error),
        }
        let directory = self.setting.resources.parent().unwrap_or(scratch);
        let (memory, limit) = (self.setting.memory, self.limit);
        let proving =
            Proving { workers: &self.workers, fmu: directory, scratch, memory, limit, deadline: until };
        proving.prove(finding)
    }

    /// Writes the program that reproduces a finding; returns whether a repetition of its calls shows it. The limit is ten times as long,
    /// except for a hang: the machine may be busy.
    fn reproduce(&self, finding: &mut Finding, until: Instant) -> anyhow::Result<bool> {
        let Some(criterion) = finding.criterion.clone() else { return Ok(false) };
        let patience = if finding.name.ends_with("hang") { 1.0 } else { 10.0 };
        let limit = patience * (self.limit + 3.0 * self.setting.repetitions);
        for _ in 0..3 {
            let remaining = until.saturating_duration_since(Instant::now()).as_secs_f64();
            if remaining <= 0.0 {
                return Err(Stop::TimeOver.into());
            }
            let run = self.workers.execute(&self.hard(finding), &finding.sequence, limit.min(remaining))?;
            let found = criterion(&run).is_some() || finding.name == "package.symbols";
            if matches!(run.end, End::Hang(seconds) if seconds < limit && !finding.name.ends_with("hang")) {
                return Err(Stop::TimeOver.into());
            }
            if found {
                crate::reproduce::program(finding, &run, &self.setting, &self.description);
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Removes calls that the finding does not need, until the instant `until` or the maximum number of attempts.
    fn shorten(&self, finding: &mut Finding, until: Instant) {
        finding.steps = (finding.sequence.len(), finding.sequence.len());
        let Some(criterion) = finding.criterion.clone() else { return };
        let setting = self.hard(finding);
        let hangs = finding.name.ends_with("hang");
        let limit = if hangs { self.limit.min(1.5) } else { self.limit };
        let mut remaining = match finding.topic() {
            _ if hangs => 12,
            "resources" => 15,
            _ => 400,
        };
        // If the criterion compares no calls, calls are removed separately.
        let removes_separately = REMOVED_SEPARATELY.contains(&finding.name.as_str());
        let ends = ["crash", "hang", "exit"].iter().any(|end| finding.name.ends_with(end));
        let pinned =
            PINNED.iter().find(|(topic, _)| *topic == finding.topic() && !ends && !removes_separately);
        let pinned = pinned.map_or(&[][..], |(_, calls)| calls);
        // The observation of a shorter sequence may differ only in its numbers.
        let (same, mut observed) = (outline(&finding.observed), finding.observed.clone());
        let mut reproduces = |tried: &CallSequence| {
            let remaining = until.saturating_duration_since(Instant::now()).as_secs_f64();
            let run = self.workers.execute(&setting, tried, limit.min(remaining)).ok();
            let now = run.and_then(|run| criterion(&run)).filter(|now| outline(now) == same);
            now.is_some_and(|now| {
                observed = now;
                true
            })
        };
        let mut short = shrink(&self.description, &finding.sequence, pinned, !removes_separately, |tried| {
            remaining -= 1;
            remaining >= 0 && Instant::now() < until && !interrupted() && reproduces(tried)
        });
        // A finding that is not reproduced by every run is not shortened.
        if short.len() < finding.sequence.len() && !reproduces(&short) {
            (short, observed) = (finding.sequence.clone(), finding.observed.clone());
        }
        finding.observed = observed;
        finding.steps.1 = short.len();
        finding.sequence = short;
    }
}

#[cfg(test)]
mod tests {
    use super::record;
    use crate::finding::{Finding, Severity};

    /// Checks that a more severe finding replaces one of the same name, whose observation remains in the list.
    #[test]
    fn no_evidence_is_lost() {
        let finding = |name: &str, severity, observed: &str| Finding {
            name: name.to_owned(),
            severity,
            observed: observed.to_owned(),
            ..Finding::default()
        };
        let mut found = Vec::new();
        for (severity, observed) in [
            (Severity::Note, "a"),
            (Severity::Note, "b"),
            (Severity::Violation, "c"),
            (Severity::Fragile, "d"),
            (Severity::Violation, "c"),
            (Severity::Violation, "e"),
            (Severity::Note, "b"),
        ] {
            record(&mut found, finding("topic.name", severity, observed));
        }
        record(&mut found, finding("topic.other", Severity::Note, "a"));
        let [one, other] = &found[..] else { panic!("{} findings", found.len()) };
        assert_eq!((one.severity, one.observed.as_str()), (Severity::Violation, "c"));
        assert_eq!(one.more, ["a", "b", "d", "e"]);
        assert_eq!((other.severity, other.observed.as_str(), other.more.len()), (Severity::Note, "a", 0));
    }
}
