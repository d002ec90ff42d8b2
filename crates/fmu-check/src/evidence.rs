//! Evidence of a finding: the results of its calls by which a repetition shows the finding. Unlike a criterion, evidence can be
//! written to a report.

use crate::call_sequence::{
    Action, CallSequence, End, Measured, Message, Numbered, Outcome, Run, Values, action_name, action_of,
};
use crate::worker::{EVALUATED, changed_setting, tolerated_growth};
use serde::{Deserialize, Serialize, Serializer};

/// Results that show a finding.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub enum Evidence {
    /// No results are known that show the finding.
    #[default]
    Unknown,
    /// The process ends in this way during an action of this name, or after all actions if there is no name.
    End(End, Option<String>),
    /// Processes are alive after the end of the call sequence, or too many processes before its end.
    Orphans,
    /// There is output on the standard output or the standard error.
    Printed,
    /// A call writes outside of its arrays for results.
    Damage,
    /// A message has an environment pointer that no instance has received.
    Strays,
    /// A read on a thread has other results than the corresponding read before the threads.
    Threads,
    /// All these calls have the expected results, and the calls of each pair have different values.
    Same(Vec<Expected>, Vec<[u32; 2]>),
    /// The quantity grows between the measurements with these numbers; settings only have to differ.
    Grown(Measure, u32, u32),
}

/// Quantity of a measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Measure {
    Memory,
    Threads,
    Files,
    /// Settings other than the files in the working directory.
    Settings,
    /// All settings.
    AllSettings,
}

/// Expected results of a call. Results that the finding does not need are `None`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Expected {
    pub id: u32,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub status: Option<i32>,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub missing: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub written: Option<Vec<Values>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log: Option<Vec<Message>>,
    /// String that the function for the version or the platform returned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub text: Option<Vec<u8>>,
    /// Whether the call has other results in each run, for example because the FMU returns memory that it has not initialized.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub varies: bool,
}

impl Expected {
    /// Returns whether a call has these results. `other` is its outcome in another run, from which results that vary must differ.
    fn fits(&self, outcome: &Outcome, other: Option<&Outcome>) -> bool {
        let results = |outcome: &Outcome| (outcome.status, outcome.written.clone(), outcome.log.clone());
        (self.status == outcome.status || self.varies && self.status.is_none())
            && self.missing == outcome.missing
            && self.written.as_ref().is_none_or(|written| *written == outcome.written)
            && self.log.as_ref().is_none_or(|log| *log == outcome.log)
            && (self.text.is_none() || self.text == outcome.text)
            && (!self.varies || other.is_some_and(|other| results(other) != results(outcome)))
    }

    /// Removes the results that the call does not have in another run, which also shows the finding.
    fn loosen(&mut self, other: &Outcome) {
        let [status, written, log] = [
            self.status != other.status,
            self.written.as_ref().is_some_and(|written| *written != other.written),
            self.log.as_ref().is_some_and(|log| *log != other.log),
        ];
        self.varies |= status || written || log;
        self.status = self.status.take().filter(|_| !status);
        self.written = self.written.take().filter(|_| !written);
        self.log = self.log.take().filter(|_| !log);
    }
}

impl Evidence {
    /// Returns whether results vary from run to run, so that two runs are needed to show the finding.
    pub fn varies(&self) -> bool {
        matches!(self, Self::Same(expected, _) if expected.iter().any(|call| call.varies))
    }

    /// Removes the results that another run does not have, although it also shows the finding.
    pub fn loosen(&mut self, other: &Run) {
        if let Self::Same(expected, _) = self {
            for call in expected {
                if let Some(outcome) = other.outcome(call.id) {
                    call.loosen(outcome);
                }
            }
        }
    }

    /// Returns whether a run of a call sequence shows the finding. Results that vary must differ from those of `other`, a second
    /// run in other processes.
    pub fn shows(&self, run: &Run, other: Option<&Run>, sequence: &CallSequence) -> bool {
        let mut outcomes = run.outcomes.values();
        let of_pair = |[one, other]: &[u32; 2]| Some((run.outcome(*one)?, run.outcome(*other)?));
        match self {
            Self::Unknown => false,
            Self::End(end, name) => {
                std::mem::discriminant(end) == std::mem::discriminant(&run.end)
                    && *name == end_name(run, sequence)
            }
            Self::Orphans => !run.orphans.is_empty() || matches!(run.end, End::Flood(_)),
            Self::Printed => !run.output.trim().is_empty(),
            Self::Damage => outcomes.any(|outcome| !outcome.damage.is_empty()),
            Self::Strays => outcomes.any(|outcome| !outcome.strays.is_empty()),
            Self::Threads => corresponding_reads(sequence).iter().filter_map(of_pair).any(|(one, other)| {
                one.status != other.status
                    || one.written.iter().zip(&other.written).any(|(one, other)| one.differ(other).is_some())
            }),
            Self::Same(expected, pairs) => {
                expected.iter().all(|call| {
                    let other = other.and_then(|other| other.outcome(call.id));
                    run.outcome(call.id).is_some_and(|outcome| call.fits(outcome, other))
                }) && pairs
                    .iter()
                    .all(|pair| of_pair(pair).is_some_and(|(one, other)| one.written != other.written))
            }
            Self::Grown(measure, first, last) => {
                let measured = |id: &u32| run.outcome(*id)?.measured.as_ref();
                measured(first)
                    .zip(measured(last))
                    .is_some_and(|(before, after)| grows(*measure, before, after, run))
            }
        }
    }
}

/// Returns the name of the action during which the process ended; `None` if all actions have returned.
pub fn end_name(run: &Run, sequence: &CallSequence) -> Option<String> {
    Some(action_name(&action_of(sequence, run.at?)?.action))
}

/// Returns whether a quantity grows. If there are repetitions, there must be enough for an evaluation.
fn grows(measure: Measure, before: &Measured, after: &Measured, run: &Run) -> bool {
    let measured = run.outcomes.values().filter_map(|outcome| outcome.measured.as_ref());
    let times = || measured.clone().map(|measured| measured.times).filter(|times| *times > 0);
    let more = |count: fn(&Measured) -> usize| count(after) > count(before) + 2;
    let is_greater = match measure {
        Measure::Memory => {
            let most = times().max().unwrap_or_default();
            after.memory.saturating_sub(before.memory) > tolerated_growth(before, most)
        }
        Measure::Threads => more(|measured| measured.threads),
        Measure::Files => more(|measured| measured.files),
        Measure::Settings => changed_setting(before, after, false).is_some(),
        Measure::AllSettings => changed_setting(before, after, true).is_some(),
    };
    is_greater && times().all(|times| times >= EVALUATED)
}

/// Pairs each read on a thread with the corresponding read before the threads: of the same instance if it was simulated before,
/// otherwise of any instance. Which pairs differ may change from run to run.
pub fn corresponding_reads(sequence: &CallSequence) -> Vec<[u32; 2]> {
    let queries = |sequence: &[Numbered]| -> Vec<(Option<usize>, u32)> {
        let query = |numbered: &Numbered| match &numbered.action {
            Action::Call { function, instance, .. } if function[4..].starts_with("Get") => {
                Some((*instance, numbered.id))
            }
            _ => None,
        };
        sequence.iter().filter_map(query).collect()
    };
    let single = queries(sequence);
    let mut pairs = Vec::new();
    for numbered in sequence {
        let Action::Parallel(sequences) = &numbered.action else { continue };
        for reads in sequences.iter().map(|sequence| queries(sequence)) {
            let own =
                single.iter().filter(|(of, _)| reads.first().is_some_and(|(instance, _)| of == instance));
            let own: Vec<_> = own.collect();
            let all: Vec<_> = if own.is_empty() { single.iter().collect() } else { own };
            pairs.extend(reads.iter().zip(all.into_iter().cycle()).map(|((_, id), (_, one))| [*one, *id]));
        }
    }
    pairs
}

/// Everything that is needed to execute the calls of a finding again.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Replay {
    /// Whether memory after each array is accessible.
    pub soft: bool,
    /// Whether the loader resolves all symbols when it loads the library.
    pub now: bool,
    /// Maximum address space of a process in bytes.
    pub memory: u64,
    /// Maximum duration of the repetitions that detect leaks in seconds.
    pub repetitions: f64,
    /// Maximum duration of a process in seconds.
    pub limit: f64,
    #[serde(serialize_with = "on_one_line")]
    pub evidence: Evidence,
    /// Calls, in which copies are folded.
    #[serde(serialize_with = "on_a_line_each")]
    pub sequence: CallSequence,
}

/// Value that is written as JSON without line breaks, because a report has a line for each number otherwise.
struct OnOneLine<'a, T>(&'a T);

impl<T: Serialize> Serialize for OnOneLine<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let line = serde_json::value::to_raw_value(self.0).map_err(serde::ser::Error::custom)?;
        line.serialize(serializer)
    }
}

fn on_one_line<S: Serializer>(value: &impl Serialize, serializer: S) -> Result<S::Ok, S::Error> {
    OnOneLine(value).serialize(serializer)
}

fn on_a_line_each<S: Serializer>(sequence: &CallSequence, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(sequence.iter().map(OnOneLine))
}
