//! Finds the evidence of a finding: the results that its criterion needs to detect the violation.

use crate::call_sequence::{End, Outcome, Run, Values};
use crate::evidence::{Evidence, Expected, Measure, corresponding_reads, end_name};
use crate::finding::{Finding, SharedCriterion};
use crate::worker::changed_setting;
use std::sync::Arc;
use std::time::Instant;

/// Maximum number of calls that are searched for pairs.
const MOST_COMPARED: usize = 12;

/// Returns the evidence of a finding from a run of its call sequence that violates its criterion; unknown if the search does not end
/// before the instant `until`.
pub fn evidence(finding: &Finding, run: &Run, until: Instant) -> Evidence {
    let Some(criterion) = &finding.criterion else { return Evidence::Unknown };
    if matches!(run.end, End::Flood(_)) {
        return Evidence::Orphans;
    }
    if run.end != End::Done {
        return Evidence::End(run.end.clone(), end_name(run, &finding.sequence));
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
    if without(&|run| run.outcomes.values_mut().for_each(|outcome| Arc::make_mut(outcome).damage.clear())) {
        return Evidence::Damage;
    }
    if without(&|run| run.outcomes.values_mut().for_each(|outcome| Arc::make_mut(outcome).strays.clear())) {
        return Evidence::Strays;
    }
    if !corresponding_reads(&finding.sequence).is_empty() {
        return Evidence::Threads;
    }
    let Some(needed) = needed(criterion, run, until) else { return Evidence::Unknown };
    let measured = |outcome: &Outcome| outcome.measured.as_ref().is_some_and(|measured| measured.times == 0);
    if needed.outcomes.values().any(|outcome| measured(outcome)) {
        return grown(finding, &needed);
    }
    let mut calls: Vec<&Outcome> =
        needed.outcomes.values().map(Arc::as_ref).filter(|outcome| outcome.measured.is_none()).collect();
    calls.sort_unstable_by_key(|outcome| outcome.id);
    if calls.is_empty() {
        return Evidence::Unknown;
    }
    let mut expected = Vec::new();
    for outcome in calls {
        if Instant::now() >= until {
            return Evidence::Unknown;
        }
        expected.push(expected_result(criterion, &needed, outcome));
    }
    let pairs = unequal(criterion, &needed, &expected);
    for call in expected.iter_mut().filter(|call| pairs.iter().any(|pair| pair.contains(&call.id))) {
        (call.written, call.log) = (None, None);
    }
    Evidence::Same(expected, pairs)
}

/// Returns the pairs of calls for which it suffices that their values differ: if both had the same value, there would be no finding, and with
/// any other value there would still be one. A replay does not compare them with the values of this run, because uninitialized memory, for
/// example, has other values in each run.
fn unequal(criterion: &SharedCriterion, run: &Run, expected: &[Expected]) -> Vec<[u32; 2]> {
    let compared: Vec<&Outcome> = expected
        .iter()
        .filter(|result| result.written.is_some())
        .filter_map(|result| run.outcome(result.id))
        .collect();
    let equalized = |from: &Outcome, to: &Outcome| {
        let mut changed = run.clone();
        let written = |outcome: &mut Arc<Outcome>| Arc::make_mut(outcome).written.clone_from(&from.written);
        changed.outcomes.entry(to.id).and_modify(written);
        criterion(&changed).is_none()
    };
    let is_violated_by_others = |of: &Outcome| {
        let mut changed = run.clone();
        let others = of.written.iter().map(Values::others).collect();
        changed.outcomes.entry(of.id).and_modify(|outcome| Arc::make_mut(outcome).written = others);
        criterion(&changed).is_some()
    };
    let mut pairs = Vec::new();
    // A criterion that needs more calls compares more than pairs.
    if compared.len() > MOST_COMPARED {
        return pairs;
    }
    for (index, one) in compared.iter().enumerate() {
        let others = compared[index + 1..].iter().filter(|other| alike(one, other));
        let other = others.into_iter().find(|other| {
            let both = [one, other];
            equalized(one, other) && equalized(other, one) && both.iter().all(|of| is_violated_by_others(of))
        });
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

/// Returns the run without the outcomes that the criterion does not need; `None` if the search does not end before `until`.
fn needed(criterion: &SharedCriterion, run: &Run, until: Instant) -> Option<Run> {
    let mut needed = run.clone();
    let mut ids: Vec<u32> = run.outcomes.keys().copied().collect();
    ids.sort_unstable();
    let mut size = ids.len().div_ceil(2);
    while size > 0 {
        for some in ids.chunks(size) {
            if Instant::now() >= until {
                return None;
            }
            let mut tried = needed.clone();
            some.iter().for_each(|id| drop(tried.outcomes.remove(id)));
            if tried.outcomes.len() < needed.outcomes.len() && criterion(&tried).is_some() {
                needed = tried;
            }
        }
        size /= 2;
    }
    Some(needed)
}

/// Returns the expected results of a call: the parts of its outcome that the criterion needs. Values and messages are left out if
/// the values only have to differ from the values of another call.
fn expected_result(criterion: &SharedCriterion, run: &Run, outcome: &Outcome) -> Expected {
    let without = |change: &dyn Fn(&mut Outcome)| {
        let mut changed = run.clone();
        changed.outcomes.entry(outcome.id).and_modify(|outcome| change(Arc::make_mut(outcome)));
        criterion(&changed).is_none()
    };
    let written = without(&|outcome| outcome.written.clear());
    let log = without(&|outcome| outcome.log.clear()) || outcome.log.is_empty() && outcome.status > Some(1);
    Expected {
        id: outcome.id,
        status: outcome.status,
        missing: outcome.missing,
        written: written.then(|| outcome.written.clone()),
        log: log.then(|| outcome.log.clone()),
        text: outcome.text.clone(),
        varies: false,
    }
}

/// Returns the comparison of the two measurements that the criterion needs.
fn grown(finding: &Finding, needed: &Run) -> Evidence {
    let measured = |outcome: &&Outcome| outcome.measured.as_ref().is_some_and(|measured| measured.times == 0);
    let mut measurements: Vec<&Outcome> =
        needed.outcomes.values().map(Arc::as_ref).filter(measured).collect();
    measurements.sort_unstable_by_key(|outcome| outcome.id);
    let [first, last] = measurements[..] else { return Evidence::Unknown };
    let changed = first.measured.as_ref().zip(last.measured.as_ref());
    let changed = changed.is_some_and(|(first, last)| changed_setting(first, last, false).is_some());
    let measure = match finding.name.as_str() {
        "resources.memory" => Measure::Memory,
        "resources.threads" => Measure::Threads,
        "resources.files" => Measure::Files,
        "resources.settings" if changed => Measure::Settings,
        "resources.settings" => Measure::AllSettings,
        _ => return Evidence::Unknown,
    };
    Evidence::Grown(measure, first.id, last.id)
}

#[cfg(test)]
mod tests {
    use super::Evidence;
    use crate::call_sequence::{Action, Arg, Kind, Numbered, Outcome, Run, Values};
    use crate::finding::{Finding, SharedCriterion};
    use std::sync::Arc;
    use std::time::{Duration, Instant};

    fn evidence(finding: &Finding, run: &Run) -> Evidence {
        super::evidence(finding, run, Instant::now() + Duration::from_secs(60))
    }

    fn finding(criterion: SharedCriterion) -> Finding {
        let call = |id: u32, function: &str| {
            let args = vec![Arg::Out(Kind::F64, 1)];
            Numbered {
                id,
                forbidden: false,
                action: Action::Call { instance: Some(0), function: function.to_owned(), args },
            }
        };
        let sequence = vec![call(1, "fmi2GetReal"), call(2, "fmi2DoStep"), call(3, "fmi2GetReal")];
        Finding::default().shown_by(sequence, criterion)
    }

    fn run() -> Run {
        let outcome = |id: u32, status: i32, value: f64| {
            let written = vec![Values::Numbers(Kind::F64, vec![value.to_bits()])];
            (id, Arc::new(Outcome { id, status: Some(status), written, ..Outcome::default() }))
        };
        Run {
            outcomes: [outcome(1, 0, 1.0), outcome(2, 3, 0.0), outcome(3, 0, 2.0)].into(),
            ..Run::default()
        }
    }

    #[test]
    fn two_reads_that_are_compared_must_differ() {
        let criterion: SharedCriterion = Arc::new(|run| {
            let (one, other) = (run.written(1)?, run.written(3)?);
            one.differ(other).map(|_| "they differ".to_owned())
        });
        let finding = finding(criterion);
        let found = evidence(&finding, &run());
        let Evidence::Same(_, pairs) = &found else { panic!("the evidence has no calls") };
        assert_eq!(*pairs, [[1, 3]]);
        let other = |of_second: u32| {
            let mut run = run();
            let written = run.outcome(of_second).map(|outcome| outcome.written.clone()).unwrap_or_default();
            run.outcomes.entry(3).and_modify(|outcome| Arc::make_mut(outcome).written = written);
            run
        };
        let shows = |run: &Run| found.shows(run, None, &finding.sequence);
        assert!(shows(&other(2)) && !shows(&other(1)));
    }

    /// A fault that returns uninitialized memory is shown by other values in each run.
    #[test]
    fn results_that_vary_must_vary_again() {
        let criterion: SharedCriterion =
            Arc::new(|run| run.status(2).filter(|status| *status > 5).map(|_| "no status".to_owned()));
        let finding = finding(criterion);
        let with_status = |status: i32| {
            let mut run = run();
            run.outcomes.entry(2).and_modify(|outcome| Arc::make_mut(outcome).status = Some(status));
            run
        };
        let mut found = evidence(&finding, &with_status(1_085_369_984));
        assert!(!found.varies());
        found.loosen(&with_status(2_066_704));
        assert!(found.varies());
        let shows = |one: i32, other: i32| {
            found.shows(&with_status(one), Some(&with_status(other)), &finding.sequence)
        };
        assert!(shows(77, 78) && !shows(0, 0));
    }

    #[test]
    fn remaining_processes_are_evidence() {
        let orphans: SharedCriterion = Arc::new(|run| run.orphans.first().cloned());
        let run = Run { orphans: vec!["sleep".to_owned()], ..run() };
        assert_eq!(evidence(&finding(orphans), &run), Evidence::Orphans);
    }
}
