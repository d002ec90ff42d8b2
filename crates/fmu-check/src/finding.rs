//! Findings, and the criteria that recognize them in a run.

use crate::call_sequence::{Action, CallSequence, End, Numbered, Run, Values, action_name, action_of};
use crate::evidence::Replay;
use serde::Serialize;
use std::sync::Arc;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Information; importers work nevertheless.
    #[default]
    Note,
    /// The standard does not forbid the observed behaviour, but importers fail.
    Fragile,
    /// The standard forbids the observed behaviour.
    Violation,
}

impl Severity {
    /// Returns the name of the severity.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Fragile => "fragile",
            Self::Violation => "violation",
        }
    }
}

/// Criterion for runs: returns a description of the violation, or `None` if the run fulfils the criterion.
pub trait Criterion: Fn(&Run) -> Option<String> + Send + Sync + 'static {}

impl<T: Fn(&Run) -> Option<String> + Send + Sync + 'static> Criterion for T {}

/// Criterion that is shared by copies of a finding.
pub type SharedCriterion = Arc<dyn Criterion>;

/// Returns a criterion that is violated if any of these criteria is violated.
pub fn any(criteria: impl IntoIterator<Item = Box<dyn Criterion>>) -> Box<dyn Criterion> {
    let criteria: Vec<_> = criteria.into_iter().collect();
    Box::new(move |run: &Run| criteria.iter().find_map(|criterion| criterion(run)))
}

/// Returns a criterion that is violated if one of these calls fails.
pub fn fails(sequence: &CallSequence, ids: Vec<u32>) -> Box<dyn Criterion> {
    let sequence = sequence.clone();
    Box::new(move |run: &Run| failure(&sequence, run, &ids))
}

/// Returns a criterion that is violated only if none of these calls fails.
pub fn unless_fails(
    sequence: &CallSequence,
    ids: Vec<u32>,
    criterion: Box<dyn Criterion>,
) -> Box<dyn Criterion> {
    let fails = fails(sequence, ids);
    Box::new(move |run: &Run| fails(run).is_none().then(|| criterion(run))?)
}

/// Whether the calls of a finding show it again.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Proof {
    /// There are no calls, because the finding concerns the files of the FMU.
    #[default]
    Files,
    /// The calls have shown the finding twice, each time in new processes.
    Shown,
    /// The calls do not show the finding again, for this reason.
    NotShown(String),
    /// The calls were not repeated, for this reason.
    NotRun(String),
}

/// Violation of a rule by an FMU.
#[derive(Clone, Default, Serialize)]
pub struct Finding {
    /// Name of the rule, which begins with its topic and a dot. If a process ended, it is the topic or a rule, followed by the
    /// end, as in `states.crash` or `states.fresh-process.crash`.
    pub name: String,
    /// Severity of the finding.
    pub severity: Severity,
    /// Edition and section of the standard; empty if the rule is not in the standard.
    pub section: String,
    /// Requirement of the rule.
    pub requirement: String,
    /// Observation that violates the requirement.
    pub observed: String,
    /// Further observations of this rule.
    pub more: Vec<String>,
    /// Call sequence that reproduces the finding; empty for a finding in the files of the FMU.
    #[serde(skip)]
    pub sequence: CallSequence,
    /// Calls of the sequence as text, each with its number; empty for a finding in the files of the FMU.
    pub calls: Vec<String>,
    /// Results of the calls that together show the finding, as text.
    pub expected: Vec<String>,
    /// Whether the calls show the finding again; if not, the reason.
    pub proof: Proof,
    /// Calls for `fmu-check replay`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub replay: Option<Replay>,
    /// Criterion that a run violates if it reproduces the finding.
    #[serde(skip)]
    pub criterion: Option<SharedCriterion>,
    /// Name of the finding that may be the cause of this one.
    pub cause: Option<String>,
    /// Whether the finding fails the check.
    pub fails: bool,
    /// Reason in the baseline why the finding is accepted.
    pub accepted: Option<String>,
    /// Number of actions before and after shortening.
    #[serde(rename = "steps")]
    pub length: (usize, usize),
}

impl Finding {
    /// Adds the call sequence and the criterion that reproduce the finding.
    pub fn shown_by(self, sequence: CallSequence, criterion: SharedCriterion) -> Self {
        Self { sequence, criterion: Some(criterion), ..self }
    }

    /// Records whether the calls show the finding again. A finding that was not shown again is a note.
    pub fn judge(&mut self, proof: Proof) {
        if matches!(proof, Proof::NotShown(_) | Proof::NotRun(_)) {
            self.severity = Severity::Note;
        }
        self.proof = proof;
    }

    /// Returns the topic of the rule.
    pub fn topic(&self) -> &str {
        topic_of(&self.name)
    }
}

/// Returns the topic of a rule; of a topic, returns the topic itself.
pub fn topic_of(name: &str) -> &str {
    name.split('.').next().unwrap_or_default()
}

/// Returns a description of the end of a process before its last action returned; `None` if the last action returned.
pub fn ending(run: &Run, sequence: &CallSequence) -> Option<String> {
    let name = run
        .at
        .and_then(|id| action_of(sequence, id))
        .map_or("the end of the process".to_owned(), |numbered| action_name(&numbered.action));
    Some(match &run.end {
        End::Done => return None,
        End::Crash(why) => format!("{name} crashes ({why})"),
        End::Hang(seconds) => format!("{name} does not return within {seconds:.1} s"),
        End::Exit(code) => format!("{name} ends the process with exit status {code}"),
        End::Unloadable(why) => {
            // Some FMUs in Python, for example of PythonFMU, do not link to the interpreter.
            let is_python =
                ["undefined symbol: Py", "undefined symbol: _Py"].iter().any(|of| why.contains(of));
            let missing = match is_python {
                true => {
                    "; it needs a process that has loaded Python, so only importers in Python can load it"
                }
                false => "",
            };
            format!("the library cannot be loaded: {why}{missing}")
        }
        End::Flood(count) => {
            format!("{name} leads to {count} processes at a time, after which all were ended")
        }
    })
}

/// Result of an update of the discrete states.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// Whether another update is needed.
    pub again: bool,
    /// Whether the model requests the end of the simulation.
    pub terminate: bool,
    /// Whether the continuous states have changed.
    pub states_changed: bool,
    /// Time of the next time event, if it is defined.
    pub next: Option<f64>,
}

/// Returns the result of an update of the discrete states; `None` if the update failed.
pub fn event(run: &Run, id: u32, fmi3: bool) -> Option<Event> {
    let outcome = run.outcome(id).filter(|outcome| outcome.status.is_some_and(|status| status <= 1))?;
    let (flags, time) = if fmi3 {
        let number = |index: usize| outcome.written.get(index)?.numbers().first().copied();
        ([0, 1, 3, 4].map(|index| number(index) == Some(1.0)), number(5)?)
    } else {
        // fmi2EventInfo has five flags of 32 bits, padding, and the time: four words of 64 bits.
        let Values::Numbers(_, words) = outcome.written.first()? else { return None };
        let [first, changed, defined, time] = words[..] else { return None };
        let flags = [first as u32 != 0, first >> 32 != 0, changed >> 32 != 0, defined as u32 != 0];
        (flags, f64::from_bits(time))
    };
    let [again, terminate, states_changed, defined] = flags;
    Some(Event { again, terminate, states_changed, next: defined.then_some(time) })
}

/// Describes the first of these calls that failed; `None` if none failed.
pub fn failure(sequence: &CallSequence, run: &Run, ids: &[u32]) -> Option<String> {
    ids.iter().find_map(|id| failure_of(sequence, run, *id))
}

/// Describes this call if it failed: its function is missing, or it returned NULL or a status worse than Warning.
pub fn failure_of(sequence: &CallSequence, run: &Run, id: u32) -> Option<String> {
    let outcome = run.outcome(id)?;
    let action = &action_of(sequence, id)?.action;
    let name = action_name(action);
    if outcome.missing {
        return Some(format!("{name} is not in the library"));
    }
    let status = outcome.status?;
    let result = match action {
        Action::Make(..) if status == 0 => "NULL".to_owned(),
        Action::Call { .. } | Action::Free(_) if status > 1 => status_name(status),
        // Discard means that it was not finished, for example because there were too many events.
        Action::Integrate(..) if status > 2 => status_name(status),
        _ => return None,
    };
    let why = outcome.log.iter().rev().find_map(|message| message.text.as_ref());
    let why = why.map_or(String::new(), |text| format!(": {:?}", String::from_utf8_lossy(text)));
    Some(format!("{name} returns {result}{why}"))
}

/// Describes the first failed instantiation, otherwise the first call that returned a status above `max_status`. If `max_status`
/// is at most 1, a missing function is a failure, too.
pub fn first_failure(sequence: &CallSequence, run: &Run, max_status: i32) -> Option<String> {
    let made = |numbered: &&Numbered| matches!(numbered.action, Action::Make(..));
    let failed = |numbered: &&Numbered| {
        matches!(numbered.action, Action::Call { .. })
            && run.outcome(numbered.id).is_some_and(|outcome| {
                outcome.status.map_or(outcome.missing && max_status < 2, |status| status > max_status)
            })
    };
    let one = |numbered: &Numbered| failure_of(sequence, run, numbered.id);
    let of_makes = sequence.iter().filter(made).find_map(one);
    of_makes.or_else(|| sequence.iter().filter(failed).find_map(one))
}

pub fn status_name(status: i32) -> String {
    let names = ["OK", "Warning", "Discard", "Error", "Fatal", "Pending"];
    let name = usize::try_from(status).ok().and_then(|index| names.get(index));
    name.map_or_else(|| status.to_string(), |name| (*name).to_owned())
}

#[cfg(test)]
mod tests {
    use super::ending;
    use crate::call_sequence::{End, Run};

    #[test]
    fn a_library_without_python_says_what_is_missing() {
        let of =
            |why: &str| ending(&Run { end: End::Unloadable(why.to_owned()), ..Run::default() }, &Vec::new());
        let python = of("a.so: undefined symbol: PyExc_RuntimeError").expect("an end");
        assert!(python.contains("a process that has loaded Python"), "{python}");
        let other = of("a.so: undefined symbol: missing").expect("an end");
        assert!(other.ends_with("undefined symbol: missing"), "{other}");
    }
}
