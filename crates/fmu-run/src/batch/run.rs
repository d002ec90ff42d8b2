//! Performs a plan: each thread performs one run after the other until none is left.

use super::Finished;
use super::plan::Plan;
use super::pulse::Pulse;
use super::watch::Watch;
use super::worker::{Exact, Failure, Worker};
use crate::error::{Error, caught, lock};
use crate::system::System;
use fmi_abi::Value;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::{self, Duration};

/// Messages, each with the index of its run.
pub(super) type Messages = Vec<(usize, String)>;

/// Maximum duration of [`repeat_with_logging`], in addition to the duration of the runs.
const PATIENCE: Duration = Duration::from_secs(2);

/// Memory for the results of a run.
struct Row<'a> {
    run: usize,
    trajectories: &'a mut [f64],
    measures: &'a mut [f64],
}

/// Performs all runs. Fills trajectories and statistics, and returns the other results.
pub(super) fn run(
    system: &System,
    plan: &Plan,
    watch: &Watch,
    [trajectories, measures]: [&mut [f64]; 2],
) -> Result<Finished, Error> {
    let begin = time::Instant::now();
    let (trajectory, measured) =
        (plan.outputs.len() * plan.stored_times(), plan.outputs.len() * plan.measures.len());
    let fits = trajectories.len() >= plan.runs * trajectory && measures.len() >= plan.runs * measured;
    assert!(fits, "there is too little memory for {} runs", plan.runs);
    let exact = plan.exact_outputs.len().checked_mul(plan.stored_times());
    let exact = exact.and_then(|each| each.checked_mul(plan.runs)).ok_or_else(Error::too_much)?;
    // The memory is freed immediately, because this only tests whether so much is available.
    Vec::<Option<Value>>::new().try_reserve_exact(exact).map_err(|_| Error::too_much())?;
    let rows = split(trajectories, trajectory).zip(split(measures, measured));
    let rows = rows.take(plan.runs).enumerate();
    let rows = Mutex::new(rows.map(|(run, (trajectories, measures))| Row { run, trajectories, measures }));
    let next = || lock(&rows).next();
    let feed = watch.listening.then(|| watch.feed.get_or_init(|| system.feed()));
    let found = on_threads(system, plan.threads, watch, |number| {
        let mut worker = Worker::new(system, plan, watch, number, None);
        worker.feed = feed.map(|feed| (Arc::clone(feed), number));
        worker.begin();
        let (mut failures, mut notes) = (Vec::new(), Vec::new());
        while !watch.is_cancelled()
            && let Some(mut row) = next()
        {
            let run = row.run;
            let result = perform(&mut worker, &mut row, plan.time);
            if watch.is_cancelled() {
                failures.push(cancelled(row));
                break;
            }
            match result {
                Ok(None) => {}
                Ok(Some(note)) => notes.push((run, note)),
                Err(failure) => failures.push((run, failure)),
            }
            watch.done.fetch_add(1, Ordering::Relaxed);
        }
        let (exact, events) = (std::mem::take(&mut worker.exact), std::mem::take(&mut worker.events));
        worker.finish();
        ((failures, notes), (exact, events))
    })?;
    let left: Vec<_> = rows.into_inner().unwrap_or_else(PoisonError::into_inner).map(cancelled).collect();
    let (found, more): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let (exact, events): (Vec<_>, Vec<_>) = more.into_iter().unzip();
    let mut events: Vec<_> = events.into_iter().flatten().collect();
    events.sort_by_key(|event| event.run);
    let (failures, notes): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let mut failures: Vec<_> = failures.into_iter().flatten().chain(left).collect();
    let mut notes: Messages = notes.into_iter().flatten().collect();
    failures.sort_unstable_by_key(|(run, _)| *run);
    notes.sort_unstable_by_key(|(run, _)| *run);
    if failures.iter().any(|(_, failure)| failure.is_silent) {
        let until = time::Instant::now() + begin.elapsed() + PATIENCE;
        repeat_with_logging(system, plan, watch, until, &mut failures)?;
    }
    let errors = failures.into_iter().map(|(run, failure)| (run, failure.text)).collect();
    Ok(Finished { errors, notes, exact: arranged(plan, exact.into_iter().flatten()), events })
}

impl Row<'_> {
    /// Sets all results to NaN.
    fn clear(&mut self) {
        self.trajectories.fill(f64::NAN);
        self.measures.fill(f64::NAN);
    }
}

/// Records that a run was not finished, because the caller has cancelled the runs.
fn cancelled(mut row: Row) -> (usize, Failure) {
    row.clear();
    (row.run, Failure { at: None, text: "cancelled".to_owned(), is_silent: false })
}

/// Performs a run over these times. If it panics, only this run fails.
fn perform(worker: &mut Worker, row: &mut Row, times: &[f64]) -> Result<Option<String>, Failure> {
    let result = caught(|| worker.run(row.run, times, row.trajectories, row.measures))
        .unwrap_or_else(|text| Err(Failure { at: None, text, is_silent: false }));
    if matches!(result, Err(Failure { at: None, .. })) {
        row.clear();
    }
    result
}

/// Sorts the values of all runs in the order of [`Runs::exact`](super::Runs::exact).
fn arranged(plan: &Plan, found: impl Iterator<Item = Exact>) -> Vec<Option<Value>> {
    let (outputs, kept) = (plan.exact_outputs.len(), plan.stored_times());
    let mut all = vec![None; plan.runs * outputs * kept];
    for (run, values) in found {
        for (index, value) in values.into_iter().enumerate() {
            let (time, output) = (index / outputs, index % outputs);
            all[(run * outputs + output) * kept + time] = Some(value);
        }
    }
    all
}

/// Repeats runs that failed without a message, because many FMUs log reasons only with logging on. Each run is repeated up to its
/// failure, and only the message is used. Stops at the time `until`.
fn repeat_with_logging(
    system: &System,
    plan: &Plan,
    watch: &Watch,
    until: time::Instant,
    failures: &mut [(usize, Failure)],
) -> Result<(), Error> {
    let silent = Mutex::new(failures.iter_mut().filter(|(_, failure)| failure.is_silent));
    let next = || lock(&silent).next();
    let repeated = on_threads(system, plan.threads, watch, |number| {
        let mut worker = Worker::new(system, plan, watch, number, Some(until));
        let mut trajectories = vec![0.0; plan.outputs.len() * plan.stored_times()];
        let mut measures = vec![0.0; plan.outputs.len() * plan.measures.len()];
        while !watch.is_cancelled()
            && time::Instant::now() < until
            && let Some((run, failure)) = next()
        {
            let times = failure.at.map_or(1, |at| at + 2).min(plan.time.len());
            let mut row = Row { run: *run, trajectories: &mut trajectories, measures: &mut measures };
            let again = perform(&mut worker, &mut row, &plan.time[..times]);
            if let Err(again) = again
                && again.at == failure.at
            {
                *failure = again;
            }
        }
    });
    repeated.map(drop)
}

/// Calls `work` in this number of threads, with the index of the thread, and returns the results in any order. The calling thread
/// has the index 0; while it waits for the others, it calls the pulse.
fn on_threads<T: Send>(
    system: &System,
    threads: usize,
    watch: &Watch,
    work: impl Fn(usize) -> T + Sync,
) -> Result<Vec<T>, Error> {
    if threads <= 1 {
        return Ok(vec![work(0)]);
    }
    let others = system.pool().take_threads(threads - 1)?;
    let (found, running, arrived) = (Mutex::new(Vec::new()), Mutex::new(threads - 1), Condvar::new());
    others.pool().in_place_scope(|scope| {
        for number in 1..threads {
            let (found, arrival, work) = (&found, Arrival(&running, &arrived), &work);
            scope.spawn(move |_| {
                let arrival = arrival;
                let result = work(number);
                lock(found).push(result);
                drop(arrival);
            });
        }
        let own = work(0);
        lock(&found).push(own);
        let mut others = lock(&running);
        while *others > 0 {
            let (waited, timeout) =
                arrived.wait_timeout(others, Pulse::INTERVAL).unwrap_or_else(PoisonError::into_inner);
            others = waited;
            if timeout.timed_out() {
                drop(others);
                watch.pulse();
                others = lock(&running);
            }
        }
    });
    system.pool().put_threads(others);
    Ok(found.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// Decrements the number of running threads when it is dropped, even after a panic.
struct Arrival<'a>(&'a Mutex<usize>, &'a Condvar);

impl Drop for Arrival<'_> {
    fn drop(&mut self) {
        *lock(self.0) -= 1;
        self.1.notify_one();
    }
}

/// Splits values into parts of this length. After the last complete part, the parts are empty.
fn split(values: &mut [f64], length: usize) -> impl Iterator<Item = &mut [f64]> {
    let mut rest = values;
    std::iter::repeat_with(move || {
        let (part, after) = std::mem::take(&mut rest).split_at_mut_checked(length).unwrap_or_default();
        rest = after;
        part
    })
}
