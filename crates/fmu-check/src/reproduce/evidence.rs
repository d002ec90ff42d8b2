//! Chooses the results that the program of a finding compares: the results that the criterion needs to detect the violation.

use crate::call_sequence::{CallSequence, End, Numbered, Outcome, Run, Step, Values};
use crate::finding::{Finding, SharedCriterion};
use std::fmt::Write as _;

/// Comparison by which a program decides whether it reproduces the finding.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Evidence {
    /// No comparison is known.
    #[default]
    None,
    /// Crash, hang or exit, or a library that cannot be loaded.
    End,
    /// Processes that are alive after the end of the call sequence, or too many processes before its end.
    Orphans,
    /// Output on the standard output or the standard error.
    Printed,
    /// Writes outside of the arrays for results.
    Damage,
    /// Messages with an environment pointer other than the one of the program.
    Strays,
    /// Pairs of calls. The results of at least one pair differ.
    Differ(Vec<[u32; 2]>),
    /// Calls that all have the expected results, and pairs of calls that all have different values.
    Same(Vec<Expected>, Vec<[u32; 2]>),
    /// Quantity, the numbers of two steps that measure it, and a limit. The quantity grows by more than the limit; settings only
    /// have to differ.
    Grown(Measure, u32, u32, u64),
}

/// Maximum number of repetitions in a program.
const REPETITIONS: usize = 500;

/// Maximum number of calls that are searched for pairs.
const MOST_COMPARED: usize = 12;

/// Quantity of a measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Measure {
    Memory,
    Threads,
    Files,
    Settings,
}

/// Expected results of a call.
#[derive(Clone, Debug, PartialEq)]
pub struct Expected {
    pub id: u32,
    /// Whether the values that the call wrote are compared, and whether its messages are.
    pub matters: [bool; 2],
    /// Results of the run, in the format of the programs.
    pub observed: String,
}

/// Returns the comparison for a finding, from a run of its call sequence.
pub fn evidence(finding: &Finding, run: &Run) -> Evidence {
    let Some(criterion) = &finding.criterion else { return Evidence::None };
    if matches!(run.end, End::Flood(_)) {
        return Evidence::Orphans;
    }
    if run.end != End::Done || finding.name == "package.symbols" {
        return Evidence::End;
    }
    let without = |change: &dyn Fn(&mut Run)| {
        let mut changed = run.clone();
        change(&mut changed);
        criterion(&changed).is_none()
    };
    if without(&|run| run.orphans.clear()) {
        return Evidence::Orphans;
    }
    if without(&|run| run.output.clear()) {
        return Evidence::Printed;
    }
    if without(&|run| run.outcomes.values_mut().for_each(|outcome| outcome.damage.clear())) {
        return Evidence::Damage;
    }
    if without(&|run| run.outcomes.values_mut().for_each(|outcome| outcome.strays.clear())) {
        return Evidence::Strays;
    }
    let pairs = pairs(&finding.sequence);
    if !pairs.is_empty() {
        return Evidence::Differ(pairs);
    }
    let needed = needed(criterion, run);
    let measured = |outcome: &&Outcome| outcome.measured.as_ref().is_some_and(|measured| measured.times == 0);
    if needed.outcomes.values().any(|outcome| measured(&outcome)) {
        return grown(finding, &needed);
    }
    let calls = needed.outcomes.values().filter(|outcome| outcome.measured.is_none());
    let mut ids: Vec<u32> = calls.map(|outcome| outcome.id).collect();
    ids.sort_unstable();
    let expected: Vec<Expected> = ids.iter().map(|id| expected_result(criterion, &needed, *id)).collect();
    let unequal = unequal(criterion, &needed, &expected);
    match &expected[..] {
        [] => Evidence::None,
        _ => Evidence::Same(expected, unequal),
    }
}

/// Returns the pairs of calls whose values only have to differ, because the criterion is fulfilled if they are equal. The program
/// does not compare them with the values of this run, because they may be different in every run.
fn unequal(criterion: &SharedCriterion, run: &Run, expected: &[Expected]) -> Vec<[u32; 2]> {
    let compared: Vec<&Outcome> = expected
        .iter()
        .filter(|result| result.matters[0])
        .filter_map(|result| run.outcome(result.id))
        .collect();
    let equalized = |from: &Outcome, to: &Outcome| {
        let mut changed = run.clone();
        changed.outcomes.entry(to.id).and_modify(|outcome| outcome.written.clone_from(&from.written));
        criterion(&changed).is_none()
    };
    let mut pairs = Vec::new();
    // A criterion that needs more calls compares more than pairs.
    if compared.len() > MOST_COMPARED {
        return pairs;
    }
    for (index, one) in compared.iter().enumerate() {
        let others = compared[index + 1..].iter().filter(|other| alike(one, other));
        let other = others.into_iter().find(|other| equalized(one, other) && equalized(other, one));
        pairs.extend(other.map(|other| [one.id, other.id]));
    }
    pairs
}

/// Returns whether two calls wrote different values of the same number and types.
fn alike(one: &Outcome, other: &Outcome) -> bool {
    let shape = |outcome: &Outcome| -> Vec<_> {
        let of = |values: &Values| match values {
            Values::Numbers(kind, bits) => (Some(*kind), bits.len()),
            Values::Strings(texts) => (None, texts.len()),
        };
        outcome.written.iter().map(of).collect()
    };
    one.written != other.written && shape(one) == shape(other)
}

/// Pairs each read on a thread with the corresponding read before the threads: of the same instance if it was simulated before,
/// otherwise of any instance. Which pairs differ may change from run to run.
fn pairs(sequence: &CallSequence) -> Vec<[u32; 2]> {
    let queries = |sequence: &[Numbered]| -> Vec<(Option<usize>, u32)> {
        let query = |numbered: &Numbered| match &numbered.step {
            Step::Call { function, instance, .. } if function[4..].starts_with("Get") => {
                Some((*instance, numbered.id))
            }
            _ => None,
        };
        sequence.iter().filter_map(query).collect()
    };
    let single = queries(sequence);
    let mut pairs = Vec::new();
    for numbered in sequence {
        let Step::Parallel(sequences) = &numbered.step else { continue };
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

/// Returns the run without the outcomes that the criterion does not need.
fn needed(criterion: &SharedCriterion, run: &Run) -> Run {
    let mut needed = run.clone();
    let mut ids: Vec<u32> = run.outcomes.keys().copied().collect();
    ids.sort_unstable();
    let mut size = ids.len().div_ceil(2);
    while size > 0 {
        for some in ids.chunks(size) {
            let mut tried = needed.clone();
            some.iter().for_each(|id| drop(tried.outcomes.remove(id)));
            if tried.outcomes.len() < needed.outcomes.len() && criterion(&tried).is_some() {
                needed = tried;
            }
        }
        size /= 2;
    }
    needed
}

/// Returns the expected results of a call: the parts of its outcome that the criterion needs.
fn expected_result(criterion: &SharedCriterion, run: &Run, id: u32) -> Expected {
    let without = |change: &dyn Fn(&mut Outcome)| {
        let mut changed = run.clone();
        changed.outcomes.entry(id).and_modify(change);
        criterion(&changed).is_none()
    };
    let matters = [
        without(&|outcome| outcome.written.clear())
            || run.outcome(id).is_some_and(|outcome| outcome.text.is_some()),
        without(&|outcome| outcome.log.clear())
            || run.outcome(id).is_some_and(|outcome| outcome.log.is_empty() && outcome.status > Some(1)),
    ];
    Expected {
        id,
        matters,
        observed: run.outcome(id).map_or(String::new(), |outcome| shown(outcome, matters)),
    }
}

/// Returns bytes as hexadecimal digits.
fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// Formats the results of a call in the same way as the programs.
fn shown(outcome: &Outcome, [written, log]: [bool; 2]) -> String {
    let mut text = String::new();
    let or_null = |bytes: &Option<Vec<u8>>| bytes.as_ref().map_or("-".to_owned(), |bytes| hex(bytes));
    if let Some(number) = outcome.status {
        let _ = write!(text, "{number};");
    }
    for array in outcome.written.iter().filter(|_| written) {
        match array {
            Values::Numbers(kind, bits) => {
                for bits in bits {
                    let mask = u64::MAX >> (64 - 8 * kind.size());
                    let _ = write!(text, "{:x},", bits & mask);
                }
            }
            Values::Strings(texts) => texts.iter().for_each(|string| {
                let _ = write!(text, "{},", or_null(string));
            }),
        }
        text.push(';');
    }
    if let Some(version) = outcome.text.as_ref().filter(|_| written) {
        let _ = write!(text, "{},;", hex(version));
    }
    for message in outcome.log.iter().filter(|_| log) {
        let _ = write!(text, "{} {} {};", message.status, or_null(&message.category), or_null(&message.text));
    }
    text
}

/// Returns the comparison of two measurements.
fn grown(finding: &Finding, needed: &Run) -> Evidence {
    let mut ids: Vec<(u32, bool)> = needed
        .outcomes
        .values()
        .filter_map(|outcome| Some((outcome.id, outcome.measured.as_ref()?.times > 0)))
        .collect();
    ids.sort_unstable();
    let times = ids.iter().rev().find(|(_, repeated)| *repeated);
    let times = times
        .and_then(|(id, _)| needed.outcome(*id)?.measured.as_ref())
        .map_or(0, |outcome| outcome.times.min(REPETITIONS) as u64);
    let measures: Vec<u32> = ids.iter().filter(|(_, repeated)| !repeated).map(|(id, _)| *id).collect();
    let known = [
        ("resources.memory", Measure::Memory, 16 * times + 4096),
        ("resources.threads", Measure::Threads, 2),
        ("resources.files", Measure::Files, 2),
        ("resources.settings", Measure::Settings, 0),
    ];
    match (&measures[..], known.into_iter().find(|(name, ..)| *name == finding.name)) {
        (&[first, last], Some((_, measure, limit))) => Evidence::Grown(measure, first, last, limit),
        _ => Evidence::None,
    }
}

/// Returns the sequence with as many repetitions as in a run, but at most `REPETITIONS`.
pub fn as_repeated(sequence: &CallSequence, run: &Run) -> CallSequence {
    let mut sequence = sequence.clone();
    for numbered in &mut sequence {
        if let (Step::Repeat(times, _), Some(measured)) =
            (&mut numbered.step, run.outcome(numbered.id).and_then(|outcome| outcome.measured.as_ref()))
        {
            *times = measured.times.min(REPETITIONS);
        }
    }
    sequence
}

#[cfg(test)]
mod tests {
    use super::{Evidence, evidence};
    use crate::call_sequence::{Arg, End, Kind, Message, Numbered, Outcome, Run, Step, Values};
    use crate::finding::{Finding, SharedCriterion};
    use std::sync::Arc;

    fn finding(criterion: SharedCriterion) -> Finding {
        let call = |id: u32, function: &str| {
            let args = vec![Arg::Out(Kind::F64, 1)];
            Numbered {
                id,
                forbidden: false,
                step: Step::Call { instance: Some(0), function: function.to_owned(), args },
            }
        };
        let sequence = vec![call(1, "fmi2GetReal"), call(2, "fmi2DoStep"), call(3, "fmi2GetReal")];
        Finding::default().shown_by(sequence, criterion)
    }

    fn run() -> Run {
        let outcome = |id: u32, status: i32, value: f64| {
            let written = vec![Values::Numbers(Kind::F64, vec![value.to_bits()])];
            (id, Outcome { id, status: Some(status), written, ..Outcome::default() })
        };
        let mut run = Run {
            outcomes: [outcome(1, 0, 1.0), outcome(2, 3, 0.0), outcome(3, 0, 2.0)].into(),
            ..Run::default()
        };
        let message = Message { status: 3, category: None, text: Some(b"no".to_vec()) };
        run.outcomes.entry(2).and_modify(|outcome| outcome.log.push(message));
        run
    }

    #[test]
    fn two_reads_that_are_compared_must_differ() {
        let criterion: SharedCriterion = Arc::new(|run| {
            let (one, other) = (run.written(1)?, run.written(3)?);
            one.differ(other).map(|_| "they differ".to_owned())
        });
        let Evidence::Same(_, pairs) = evidence(&finding(criterion), &run()) else {
            panic!("the evidence has no calls")
        };
        assert_eq!(pairs, [[1, 3]]);
    }

    #[test]
    fn a_call_that_fails_must_fail_again() {
        let criterion: SharedCriterion =
            Arc::new(|run| run.status(2).filter(|status| *status == 3).map(|_| "it fails".to_owned()));
        let Evidence::Same(expected, _) = evidence(&finding(criterion), &run()) else {
            panic!("the evidence has no calls")
        };
        assert_eq!(expected.iter().map(|result| result.observed.as_str()).collect::<Vec<_>>(), ["3;"]);
    }

    #[test]
    fn messages_are_compared_where_they_matter() {
        let criterion: SharedCriterion =
            Arc::new(|run| run.outcome(2)?.log.first().map(|_| "a message".to_owned()));
        let Evidence::Same(expected, _) = evidence(&finding(criterion), &run()) else {
            panic!("the evidence has no calls")
        };
        assert_eq!(expected[0].observed, "3;3 - 6e6f;");
    }

    #[test]
    fn the_end_of_a_process_is_evidence() {
        let criterion: SharedCriterion =
            Arc::new(|run| (run.end != End::Done).then(|| "it crashes".to_owned()));
        let crashed = Run { end: End::Crash(String::new()), ..run() };
        assert_eq!(evidence(&finding(criterion), &crashed), Evidence::End);
        let orphans: SharedCriterion = Arc::new(|run| run.orphans.first().cloned());
        let run = Run { orphans: vec!["sleep".to_owned()], ..run() };
        assert_eq!(evidence(&finding(orphans), &run), Evidence::Orphans);
    }
}
