//! Evaluates runs: finds violations of rules, and processes that ended before the last action returned.

use super::{Checker, at};
use crate::always;
use crate::call_sequence::{CallSequence, End, Run, Setting, action_name};
use crate::finding::{Criterion, Event, Finding, Severity, SharedCriterion, ending, event};
use crate::rules;
use crate::writer::{Read, difference};
use std::sync::Arc;

impl Checker {
    /// Records a finding if a run breaks a rule; returns whether it does. Returns false for a run that ended before its last action
    /// returned.
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

    /// Executes a call sequence and records its findings: the end of the process or, if the last action returned, the violations
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

    /// Returns a criterion that is violated if corresponding reads differ. In the message, the three `{}` are replaced by the
    /// variable, its value in `one` and its value in `other`.
    pub fn differ(&self, one: &[Read], other: &[Read], message: &'static str) -> Box<dyn Criterion> {
        self.differ_by(0.0, one, other, message)
    }

    /// Returns the reads of numbers and vectors, without those of strings and bytes.
    pub fn numeric(&self, mut reads: Vec<Read>) -> Vec<Read> {
        let is_number = |(index, _): &(usize, usize)| self.description.variables[*index].is_number();
        reads.retain(|read| read.variables.iter().all(is_number));
        reads
    }

    /// Returns a criterion like `differ`, which allows relative differences up to `tolerance`.
    pub fn differ_by(
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

    /// Returns a criterion like `differ`, which allows differences up to 20 times the tolerance of the default experiment. A
    /// solver with variable steps that continues from a restored state may differ by more than the tolerance, because the
    /// tolerance limits the error of a single step, while the errors of several steps add up and derivatives amplify them.
    pub fn continued(&self, one: &[Read], other: &[Read], message: &'static str) -> Box<dyn Criterion> {
        self.differ_by(20.0 * self.description.tolerance(), one, other, message)
    }

    /// Returns the reason why the library cannot be loaded, if this machine is the reason: it lacks a shared library that the FMU
    /// does not contain, or one of its system libraries is too old.
    pub fn lacks(&self, run: &Run) -> Option<String> {
        let End::Unloadable(why) = &run.end else { return None };
        let missing = why.split_once(": cannot open shared object file").map(|(name, _)| name.trim());
        let missing = missing.map(|name| name.rsplit_once(": ").map_or(name, |(_, name)| name));
        let directory = self.setting.libraries.iter().flatten().find_map(|library| library.parent());
        // If the FMU contains the missing library, no machine finds it, so the FMU is the reason.
        let is_missing = |name: &&str| {
            directory.is_some_and(|directory| !directory.join(name).exists() && !name.contains('/'))
        };
        let old = ["`GLIBC_", "`GLIBCXX_", "`CXXABI_", "`GCC_"].iter().any(|version| why.contains(version));
        match missing.filter(is_missing) {
            Some(name) => Some(format!("this machine lacks {name}, which the library needs")),
            None => old.then(|| format!("a system library of this machine is too old: {why}")),
        }
    }

    /// Records the finding of a run that ended before its last action returned, unless this machine is the reason.
    fn ended(&self, rule: &str, sequence: &CallSequence, run: &Run, forbidden: bool) -> anyhow::Result<()> {
        let Some(observed) = ending(run, sequence) else { return Ok(()) };
        if self.lacks(run).is_some() {
            return Ok(());
        }
        let ends: SharedCriterion = {
            let (sequence, kind) = (sequence.clone(), std::mem::discriminant(&run.end));
            let name_at =
                |run: &Run, sequence: &CallSequence| at(sequence, run).map(|at| action_name(&at.action));
            let at = name_at(run, &sequence);
            let floods = matches!(run.end, End::Flood(_));
            Arc::new(move |run: &Run| {
                // How many processes are alive at a time depends on the scheduler, so any remaining process reproduces the
                // finding.
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
        // If a repetition with accessible memory after each array does not crash, or changes that memory, the crash was an access
        // beyond an array.
        if matches!(run.end, End::Crash(_)) && cfg!(unix) && !forbidden {
            let soft = Setting { soft: true, ..self.setting.clone() };
            let again = self.workers.execute(&soft, sequence, self.limit)?;
            if again.outcomes.values().any(|outcome| !outcome.damage.is_empty()) {
                return record("arrays.written-beyond", format!("{observed}: it writes beyond an array"));
            }
            // A crash that does not happen each time is not an access beyond an array.
            let repeats =
                || anyhow::Ok(self.workers.execute(&self.setting, sequence, self.limit)?.end == run.end);
            if again.end == End::Done && repeats()? {
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
        // The finding has the name of the rule if only its call sequence can end the process in this way, otherwise the name of
        // the topic.
        let has_own_name =
            ["fresh-process", "unload", "exit", "location"].iter().any(|name| rule.ends_with(name));
        let name = match rule.split_once('.') {
            Some((topic, _)) if !has_own_name && (!forbidden || topic == "rejections") => topic,
            _ => rule,
        };
        record(&format!("{name}.{what}"), observed)
    }

    /// Returns the result of an update of the discrete states; `None` if the update failed.
    pub fn event(&self, run: &Run, id: u32) -> Option<Event> {
        event(run, id, self.fmi3())
    }
}
