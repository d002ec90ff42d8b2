//! Findings: severity, section of the standard, and the shortest call sequence that shows the finding.

use crate::call_sequence::{CallSequence, End, Numbered, Run, Step, Values, step_of};
use serde::Serialize;
use std::sync::Arc;

/// Severity of a finding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// Information.
    #[default]
    Note,
    /// The standard allows it, but importers fail.
    Fragile,
    /// The standard requires it.
    Violation,
}

impl Severity {
    /// Its name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Fragile => "fragile",
            Self::Violation => "violation",
        }
    }
}

/// Judges a run; returns a sentence that describes the violation.
pub trait Criterion: Fn(&Run) -> Option<String> + Send + Sync + 'static {}

impl<T: Fn(&Run) -> Option<String> + Send + Sync + 'static> Criterion for T {}

/// A judge that findings share.
pub type SharedCriterion = Arc<dyn Criterion>;

/// Judges by the first of these judges that finds a violation.
pub fn any(criteria: impl IntoIterator<Item = Box<dyn Criterion>>) -> Box<dyn Criterion> {
    let criteria: Vec<_> = criteria.into_iter().collect();
    Box::new(move |run: &Run| criteria.iter().find_map(|criterion| criterion(run)))
}

/// Judges whether one of these calls did not return OK.
pub fn fails(sequence: &CallSequence, ids: Vec<u32>) -> Box<dyn Criterion> {
    let sequence = sequence.clone();
    Box::new(move |run: &Run| failure(&sequence, run, &ids))
}

/// A finding.
#[derive(Clone, Default, Serialize)]
pub struct Finding {
    /// Its name: the topic, a dot, the fault.
    pub name: String,
    /// Its severity.
    pub severity: Severity,
    /// The edition and section of the standard; empty if the rule is not part of it.
    pub section: String,
    /// The requirement.
    pub requirement: String,
    /// The observation.
    pub observed: String,
    /// Further observations of this rule.
    pub more: Vec<String>,
    /// The calls that show it; empty for findings in files.
    #[serde(skip)]
    pub sequence: CallSequence,
    /// The call sequence as a program in C.
    pub c: String,
    /// Judges whether a run shows the finding.
    #[serde(skip)]
    pub criterion: Option<SharedCriterion>,
    /// Whether it fails the check.
    pub fails: bool,
    /// The reason for which it is accepted, if the baseline has one.
    pub accepted: Option<String>,
    /// The numbers of steps before and after shortening.
    pub steps: (usize, usize),
}

impl Finding {
    /// Adds the calls that show the finding.
    pub fn shown_by(self, sequence: CallSequence, criterion: SharedCriterion) -> Self {
        Self { sequence, criterion: Some(criterion), ..self }
    }

    /// Its topic.
    pub fn topic(&self) -> &str {
        self.name.split('.').next().unwrap_or_default()
    }
}

/// Returns a sentence on a run that crashed, hung or exited, with the function in which it did.
pub fn ending(run: &Run, sequence: &CallSequence) -> Option<String> {
    let name = run
        .at
        .and_then(|id| step_of(sequence, id))
        .map_or("the end of the process".to_owned(), |numbered| step_name(&numbered.step));
    Some(match &run.end {
        End::Done => return None,
        End::Crash(why) => format!("{name} crashes ({why})"),
        End::Hang(seconds) => format!("{name} does not return within {seconds:.1} s"),
        End::Exit(code) => format!("{name} ends the whole process with exit status {code}"),
        End::Unloadable(why) => format!("the library cannot be loaded: {why}"),
        End::Flood(count) => format!("{name} leads to {count} processes at once, after which all were ended"),
    })
}

/// A short description of a step.
pub fn step_name(step: &Step) -> String {
    match step {
        Step::Make(..) => "the instantiation".to_owned(),
        Step::Free(_) => "FreeInstance".to_owned(),
        Step::Call { function, .. } | Step::Version(function) => function.clone(),
        Step::Repeat(times, steps) => format!(
            "one of {times} repetitions of {}",
            steps.first().map_or("nothing".to_owned(), |numbered| step_name(&numbered.step))
        ),
        Step::Parallel(sequences) => format!("a call on one of {} threads", sequences.len()),
        Step::Measure => "a measurement".to_owned(),
        Step::FreshProcess => "a fresh process".to_owned(),
        Step::Unload => "unloading the library".to_owned(),
        Step::Quit => "the exit of the process".to_owned(),
    }
}

/// The result of an event.
#[derive(Clone, Copy, Debug)]
pub struct Event {
    /// Another update is needed.
    pub again: bool,
    /// The model wants to end.
    pub terminate: bool,
    /// Continuous states have changed.
    pub states_changed: bool,
    /// The next time event.
    pub next: Option<f64>,
}

/// The result of a successful update of the discrete states.
pub fn event(run: &Run, id: u32, fmi3: bool) -> Option<Event> {
    let outcome = run.outcome(id).filter(|outcome| outcome.status.is_some_and(|status| status <= 1))?;
    let (flags, time) = if fmi3 {
        let number = |index: usize| outcome.written.get(index)?.numbers().first().copied();
        ([0, 1, 3, 4].map(|index| number(index) == Some(1.0)), number(5)?)
    } else {
        // fmi2EventInfo has five flags, two to a word, and the time.
        let Values::Numbers(_, words) = outcome.written.first()? else { return None };
        let [first, changed, defined, time] = words[..] else { return None };
        let flags = [first as u32 != 0, first >> 32 != 0, changed >> 32 != 0, defined as u32 != 0];
        (flags, f64::from_bits(time))
    };
    let [again, terminate, states_changed, defined] = flags;
    Some(Event { again, terminate, states_changed, next: defined.then_some(time) })
}

/// Returns a sentence on the first of these calls that did not return OK.
pub fn failure(sequence: &CallSequence, run: &Run, ids: &[u32]) -> Option<String> {
    ids.iter().find_map(|id| failure_of(sequence, run, *id))
}

/// Returns a sentence on this call if it did not return OK.
pub fn failure_of(sequence: &CallSequence, run: &Run, id: u32) -> Option<String> {
    let outcome = run.outcome(id)?;
    let step = &step_of(sequence, id)?.step;
    let name = step_name(step);
    if outcome.missing {
        return Some(format!("{name} is not in the library"));
    }
    let status = outcome.status?;
    let result = match step {
        Step::Make(..) if status == 0 => "NULL".to_owned(),
        Step::Call { .. } | Step::Free(_) if status > 1 => status_name(status),
        _ => return None,
    };
    let why = outcome.log.iter().rev().find_map(|message| message.text.as_ref());
    let why = why.map_or(String::new(), |text| format!(": {:?}", String::from_utf8_lossy(text)));
    Some(format!("{name} returns {result}{why}"))
}

/// Returns a sentence on the first failed instantiation, otherwise on the first call that returns more than `most`.
pub fn first_failure(sequence: &CallSequence, run: &Run, most: i32) -> Option<String> {
    let made = |numbered: &&Numbered| matches!(numbered.step, Step::Make(..));
    let failed = |numbered: &&Numbered| {
        matches!(numbered.step, Step::Call { .. })
            && run.outcome(numbered.id).is_some_and(|outcome| {
                outcome.status.map_or(outcome.missing && most < 2, |status| status > most)
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
