//! Executes the checks of an FMU and proves its findings, on several threads.

use crate::activity::Activity;
use crate::checker::Checker;
use crate::checks::{ALL, Check, malformed};
use crate::finding::{Finding, topic_of};
use crate::options::Options;
use crate::rules::TOPICS;
use crate::run::Stop;
use crate::worker::interrupted;
use crate::writer::Trajectory;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Reason that the report states for a topic until all its checks have ended, because the report is written after every check.
const UNFINISHED: &str = "it is not finished";

/// Returns the reason why a part was not checked. After an interrupt this is the interrupt, because the error may only say that a
/// process or a file is missing.
pub fn stop(error: &anyhow::Error) -> String {
    if interrupted() { Stop::Interrupted.to_string() } else { error.to_string() }
}

/// Returns the number of threads that execute checks: one for each processor, at most 8.
fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from).min(8)
}

/// Calls `each` on several threads with every item and the number of items that have begun, until the check is closed. The line that
/// `each` returns becomes the activity.
fn in_parallel<T: Sync>(
    checker: &Checker,
    items: &[T],
    activity: &Activity,
    each: impl Fn(&T, usize) -> String + Sync,
) {
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..threads() {
            scope.spawn(|| {
                while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let line = each(item, done.fetch_add(1, Ordering::Relaxed) + 1);
                    if checker.is_closed() {
                        break;
                    }
                    activity.set(&line);
                }
            });
        }
    });
    if !checker.is_closed() {
        activity.set("");
    }
}

/// Executes a check: with a simulation if the check fits the simulation, without one if the check is executed once per FMU. In
/// other cases does nothing.
fn execute_check(checker: &Checker, check: Check, trajectory: Option<&Trajectory>) -> anyhow::Result<()> {
    match (check, trajectory) {
        (Check::Once(check), None) => check(checker),
        (Check::Each(fits, check), Some(trajectory)) if fits.fit(checker, trajectory) => {
            check(checker, trajectory)
        }
        (Check::Malformed(rule, fits, write), Some(trajectory)) if fits.fit(checker, trajectory) => {
            malformed::all(checker, rule, write(checker, trajectory)?)
        }
        _ => Ok(()),
    }
}

/// Executes all checks of the wanted topics and rules on several threads, and calls `write_report` after each check. Returns an error if a
/// check or `write_report` fails; a check that is stopped does not fail.
pub fn execute_checks(
    checker: &Checker,
    activity: &Activity,
    wanted: &(impl Fn(&str) -> bool + Sync),
    write_report: &(impl Fn() -> anyhow::Result<()> + Sync),
) -> anyhow::Result<()> {
    let wanted_checks = ALL.iter().filter(|(name, _)| wanted(name));
    let jobs: Vec<_> = wanted_checks
        .flat_map(|(name, check)| {
            let each = checker.trajectories.iter().map(Some);
            std::iter::once(None).chain(each).map(move |trajectory| (topic_of(name), *check, trajectory))
        })
        .collect();
    // The report lists a topic as not checked until all its checks have ended.
    let remaining: Vec<(&str, AtomicUsize)> = TOPICS
        .into_iter()
        .map(|topic| (topic, AtomicUsize::new(jobs.iter().filter(|(of, ..)| *of == topic).count())))
        .filter(|(_, count)| count.load(Ordering::Relaxed) > 0)
        .collect();
    remaining.iter().for_each(|(topic, _)| checker.unchecked(topic, UNFINISHED.to_owned()));
    let failure = Mutex::new(None);
    in_parallel(checker, &jobs, activity, |(topic, check, trajectory), done| {
        let result = match execute_check(checker, *check, *trajectory) {
            Err(error) if error.is::<Stop>() || interrupted() => {
                checker.stopped(topic, stop(&error));
                Ok(())
            }
            result => result,
        };
        let counts = remaining.iter().filter(|(of, _)| of == topic);
        if counts.map(|(_, count)| count.fetch_sub(1, Ordering::Relaxed)).any(|count| count == 1) {
            checker.finished(topic, UNFINISHED);
        }
        if let Err(error) = result.and_then(|()| checker.unless_closed(write_report)) {
            *failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
        }
        let remaining = checker.deadline.saturating_duration_since(Instant::now()).as_secs();
        let (all, executed) = (jobs.len(), checker.executed());
        format!("{done} of {all} checks, {executed} call sequences run, {remaining} s remaining: {topic:20}")
    });
    failure.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
}

/// Repeats the call sequences of all findings, the most severe first, and then shortens those that show their finding again. Each
/// finding gets an equal share of the remaining time. What is not reproduced is only a note, so the repetitions come first.
pub fn prove(checker: &Checker, findings: &[Mutex<Finding>], options: &Options, activity: &Activity) {
    let each = |doing: &str, work: fn(&Checker, &mut Finding, Instant)| {
        let count = findings.len();
        in_parallel(checker, findings, activity, |slot, number| {
            let mut finding = slot.lock().unwrap_or_else(PoisonError::into_inner);
            let rounds = (count + 1 - number).div_ceil(threads());
            let share =
                checker.end.saturating_duration_since(Instant::now()) / u32::try_from(rounds).unwrap_or(1);
            work(checker, &mut finding, Instant::now() + share);
            format!("{doing} {count} findings: {:40}", finding.name)
        });
    };
    each("repeating the calls of", Checker::prove);
    if !options.no_shrink {
        each("the shortest calls for", Checker::shorten);
    }
}
