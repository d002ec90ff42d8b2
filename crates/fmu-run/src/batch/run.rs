//! Performs a plan: each thread has an instance, which it resets from run to run.

use super::measure::Measured;
use super::plan::{ByTime, Plan, Values};
use crate::error::Error;
use crate::rejection::{Message, Rejection};
use crate::running::Running;
use crate::system::System;
use fmi_abi::Interface;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{self, Duration};

/// Messages with the number of their run.
pub(super) type Told = Vec<(usize, String)>;

/// Maximum time for [`ask`], in addition to the time of the runs.
const PATIENCE: Duration = Duration::from_secs(2);

/// Access for another thread to the progress of [`System::run`].
#[derive(Debug, Default)]
pub struct Watch {
    done: AtomicUsize,
    cancelled: AtomicBool,
    ended: Mutex<Vec<(usize, f64, Vec<f64>)>>,
    /// Messages of runs, each with its time, if the caller wants them.
    messages: Option<Mutex<Vec<(usize, f64, Message)>>>,
}

impl Watch {
    /// Creates a watch that receives all messages of the FMU. Logging is switched on.
    pub fn listening() -> Self {
        Self { messages: Some(Mutex::default()), ..Self::default() }
    }

    /// Returns the messages so far, each with the number of the run and the time of the communication point.
    pub fn messages(&self) -> Vec<(usize, f64, Message)> {
        self.messages.as_ref().map(|messages| lock(messages).clone()).unwrap_or_default()
    }

    /// Returns the runs that the FMU has ended, each with its end time in s and the outputs at this time, which
    /// are NaN if they cannot be read.
    pub fn ended(&self) -> Vec<(usize, f64, Vec<f64>)> {
        lock(&self.ended).clone()
    }

    fn hear(&self, run: usize, time: f64, instance: &Running) {
        if let Some(messages) = &self.messages {
            let new = instance.take_messages().into_iter().map(|message| (run, time, message));
            lock(messages).extend(new);
        }
    }

    /// Returns the number of finished runs, including failed ones.
    pub fn done(&self) -> usize {
        self.done.load(Ordering::Relaxed)
    }

    /// Cancels the runs: no further run begins, and current runs end after their step.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

fn lock<T>(mutex: &Mutex<T>) -> std::sync::MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What a run has to fill.
struct Row<'a> {
    run: usize,
    trajectories: &'a mut [f64],
    measures: &'a mut [f64],
}

/// Fills trajectories and statistics; returns errors and notes.
pub(super) fn run(
    system: &System,
    plan: &Plan,
    watch: &Watch,
    [trajectories, measures]: [&mut [f64]; 2],
) -> Result<[Told; 2], Error> {
    let begin = time::Instant::now();
    let (trajectory, measured) = (plan.outputs.len() * plan.kept(), plan.outputs.len() * plan.measures.len());
    let room = trajectories.len() >= plan.runs * trajectory && measures.len() >= plan.runs * measured;
    assert!(room, "there is too little room for {} runs", plan.runs);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(plan.threads)
        .build()
        .map_err(|error| Error::Fmu(format!("no threads can be made: {error}")))?;
    let rows = split(trajectories, trajectory).zip(split(measures, measured));
    let rows = rows.take(plan.runs).enumerate();
    let rows = Mutex::new(rows.map(|(run, (trajectories, measures))| Row { run, trajectories, measures }));
    let next = || rows.lock().unwrap_or_else(PoisonError::into_inner).next();
    // Each thread has one instance and takes the next run.
    let found = pool.broadcast(|_| {
        let mut worker = Worker::new(system, plan, watch, None);
        let (mut failures, mut notes) = (Vec::new(), Vec::new());
        while !watch.is_cancelled()
            && let Some(row) = next()
        {
            let Row { run, trajectories, measures } = row;
            let result = worker.run(run, plan.time, trajectories, measures);
            if watch.is_cancelled() {
                break;
            }
            match result {
                Ok(None) => {}
                Ok(Some(note)) => notes.push((run, note)),
                Err(failure) => failures.push((run, failure)),
            }
            watch.done.fetch_add(1, Ordering::Relaxed);
        }
        (failures, notes)
    });
    drop(rows);
    if watch.is_cancelled() && watch.done() < plan.runs {
        return Err(Error::Cancelled);
    }
    let (failures, notes): (Vec<_>, Vec<_>) = found.into_iter().unzip();
    let mut failures: Vec<_> = failures.into_iter().flatten().collect();
    let mut notes: Told = notes.into_iter().flatten().collect();
    failures.sort_unstable_by_key(|(run, _)| *run);
    notes.sort_unstable_by_key(|(run, _)| *run);
    let until = time::Instant::now() + begin.elapsed() + PATIENCE;
    if failures.iter().any(|(_, failure)| failure.is_silent) {
        pool.install(|| ask(system, plan, watch, until, &mut failures));
    }
    Ok([failures.into_iter().map(|(run, failure)| (run, failure.text)).collect(), notes])
}

/// Repeats runs that failed without a message, because many FMUs give reasons only with logging on. Repeats
/// each run up to its failure, after all other runs, and keeps only the message.
fn ask(system: &System, plan: &Plan, watch: &Watch, until: time::Instant, failures: &mut [(usize, Failure)]) {
    let silent = Mutex::new(failures.iter_mut().filter(|(_, failure)| failure.is_silent));
    let next = || silent.lock().unwrap_or_else(PoisonError::into_inner).next();
    rayon::broadcast(|_| {
        let mut worker = Worker::new(system, plan, watch, Some(until));
        let mut trajectories = vec![0.0; plan.outputs.len() * plan.kept()];
        let mut measures = vec![0.0; plan.outputs.len() * plan.measures.len()];
        while !watch.is_cancelled()
            && time::Instant::now() < until
            && let Some((run, failure)) = next()
        {
            let times = failure.at.map_or(0, |at| at + 2).min(plan.time.len());
            let again = worker.run(*run, &plan.time[..times], &mut trajectories, &mut measures);
            if let Err(again) = again
                && again.at == failure.at
            {
                *failure = again;
            }
        }
    });
}

/// Returns the requested number of parts of equal length; parts after the end of the values are empty.
fn split(values: &mut [f64], length: usize) -> impl Iterator<Item = &mut [f64]> {
    let mut rest = values;
    std::iter::repeat_with(move || {
        let (part, after) = std::mem::take(&mut rest).split_at_mut_checked(length).unwrap_or_default();
        rest = after;
        part
    })
}

/// Failure of a run before its last time.
struct Failure {
    /// Index of the time of the failure; `None` before the end of the initialization.
    at: Option<usize>,
    text: String,
    /// Whether the FMU gave no reason.
    is_silent: bool,
}

/// Instance and buffers of a thread.
struct Worker<'a> {
    system: &'a System,
    plan: &'a Plan<'a>,
    watch: &'a Watch,
    /// Deadline of a run with logging on; `None` without logging.
    logging: Option<time::Instant>,
    instance: Option<Running>,
    room: Room<'a>,
}

struct Room<'a> {
    /// Values of the inputs in this run.
    inputs: Vec<ByTime<'a>>,
    derivatives: Vec<ByTime<'a>>,
    /// Buffers for calls of the FMU.
    set: Vec<f64>,
    slopes: Vec<f64>,
    orders: Vec<i32>,
    /// Outputs at a time, in their order.
    row: Vec<f64>,
    /// Number of times that the run has reached.
    rows: usize,
    measured: Measured,
}

impl<'a> Room<'a> {
    fn of(plan: &Plan<'a>) -> Self {
        Self {
            inputs: Vec::new(),
            derivatives: Vec::new(),
            set: vec![0.0; plan.inputs.variables.len()],
            slopes: vec![0.0; plan.derivatives.variables.len()],
            orders: vec![1; plan.derivatives.variables.len()],
            row: vec![0.0; plan.outputs.len()],
            rows: 0,
            measured: Measured::new(plan.measures, plan.outputs.len()),
        }
    }

    fn begin(&mut self, plan: &Plan<'a>, run: usize) {
        let of_run = |values: &Vec<Values<'a>>| values.iter().map(|values| values.of_run(run)).collect();
        self.inputs = of_run(&plan.inputs.values);
        self.derivatives = of_run(&plan.derivatives.values);
        self.rows = 0;
        self.measured.begin();
    }
}

impl<'a> Worker<'a> {
    fn new(system: &'a System, plan: &'a Plan<'a>, watch: &'a Watch, logging: Option<time::Instant>) -> Self {
        Self { system, plan, watch, logging, instance: None, room: Room::of(plan) }
    }

    /// Performs a run over these times. May return a note if the run reaches the last time.
    fn run(
        &mut self,
        run: usize,
        times: &[f64],
        trajectories: &mut [f64],
        measures: &mut [f64],
    ) -> Result<Option<String>, Failure> {
        let plan = self.plan;
        let mut instance = match self.instance() {
            Ok(instance) => instance,
            Err((text, is_silent)) => {
                trajectories.fill(f64::NAN);
                measures.fill(f64::NAN);
                return Err(Failure { at: None, text, is_silent });
            }
        };
        self.room.begin(plan, run);
        let until = Until { watch: self.watch, logging: self.logging };
        let stopped = follow(plan, times, &mut instance, &mut self.room, run, trajectories, &until).err();
        if self.logging.is_none() {
            let at = stopped.as_ref().and_then(|(at, _)| *at).map_or(0, |at| at.min(times.len() - 1));
            self.watch.hear(run, times[at], &instance);
            let ended = stopped.as_ref().and_then(|(_, rejection)| rejection.ended());
            lock(&self.watch.ended).extend(ended.map(|time| (run, time, self.room.row.clone())));
        }
        let filled = plan.every.map_or(0, |every| self.room.rows.div_ceil(every));
        for trajectory in trajectories.chunks_mut(plan.kept().max(1)) {
            trajectory[filled..].fill(f64::NAN);
        }
        let rejected = stopped.as_ref().is_some_and(|(_, rejection)| rejection.ended().is_none());
        for (output, row) in measures.chunks_mut(plan.measures.len().max(1)).enumerate() {
            for (value, measure) in row.iter_mut().zip(plan.measures) {
                *value = if rejected { f64::NAN } else { self.room.measured.measure(*measure, output) };
            }
        }
        let terminated = if rejected { Ok(()) } else { instance.terminate() };
        self.instance = Some(instance).filter(Running::is_alive);
        let Some((at, rejection)) = stopped else {
            return Ok(terminated.err().map(|rejection| format!("finished; then {rejection}")));
        };
        if !rejected && self.room.rows == plan.time.len() {
            return Ok(Some(rejection.to_string()));
        }
        let text = match at {
            Some(at) if rejected => format!("at {} s: {rejection}", times[at]),
            _ => rejection.to_string(),
        };
        Err(Failure { at, text, is_silent: rejection.is_silent() })
    }

    /// Returns a new or reset instance. The error contains the reason, and whether there is no message.
    fn instance(&mut self) -> Result<Running, (String, bool)> {
        let used = self.instance.take();
        let logging_on = self.logging.is_some() || self.watch.messages.is_some();
        let instance = Running::renewed(used, self.system, Interface::CoSimulation, logging_on)?;
        instance.forget_log();
        Ok(instance)
    }
}

/// Index of the time (`None` before the end of the initialization) and the error.
type Stopped = (Option<usize>, Rejection);

/// Conditions that end a run early.
struct Until<'a> {
    watch: &'a Watch,
    logging: Option<time::Instant>,
}

/// Runs an instance from the start values to the last time, or until the caller cancels or the deadline
/// passes.
fn follow(
    plan: &Plan,
    times: &[f64],
    instance: &mut Running,
    room: &mut Room,
    run: usize,
    trajectories: &mut [f64],
    until: &Until,
) -> Result<(), Stopped> {
    start(plan, instance, room, run).map_err(|rejection| (None, rejection))?;
    instance.forget_log();
    let hear = |time: f64, instance: &Running| {
        if until.logging.is_none() {
            until.watch.hear(run, time, instance);
        }
    };
    hear(times[0], instance);
    let measures = !plan.measures.is_empty();
    // Index of the next kept value in a trajectory, and number of times until then.
    let (kept, mut index, mut wait) = (plan.kept(), 0, 0);
    let mut ended: Option<Rejection> = None;
    for (k, &time) in times.iter().enumerate() {
        let at = |rejection| (Some(k), rejection);
        if until.watch.is_cancelled() {
            return Ok(());
        }
        if let Some(logged) = until.logging {
            // Messages about earlier steps are not the reason of a later error.
            instance.forget_log();
            drop(instance.take_messages());
            if time::Instant::now() > logged {
                return Ok(());
            }
        }
        if !plan.read_before_set && ended.is_none() {
            set_inputs(plan, instance, room, k).map_err(at)?;
        }
        let keep = wait == 0 && index < kept;
        if (keep || measures)
            && let Err(rejection) = instance.get(&plan.outputs, &mut room.row)
        {
            return Err(at(ended.unwrap_or(rejection)));
        }
        if keep {
            // Avoids `chunks`, which would calculate the number of chunks each time.
            for (output, value) in room.row.iter().enumerate() {
                trajectories[output * kept + index] = *value;
            }
            index += 1;
            wait = plan.every.unwrap_or(1);
        }
        wait = wait.saturating_sub(1);
        if measures {
            room.measured.add(time, &room.row);
        }
        room.rows = k + 1;
        if let Some(ended) = ended {
            return Err(at(ended));
        }
        if plan.read_before_set {
            set_inputs(plan, instance, room, k).map_err(at)?;
        }
        if let Some(next) = times.get(k + 1) {
            let size = next - time;
            match instance.step(time, size) {
                Ok(()) => hear(time, instance),
                Err(rejection) => {
                    let Some(end) = rejection.ended() else { return Err(at(rejection)) };
                    // Outputs can be read, but inputs no longer set (section 4.2.4 of FMI 2.0).
                    if instance.get(&plan.outputs, &mut room.row).is_err() {
                        room.row.fill(f64::NAN);
                    }
                    if next - end > 1e-9 * size {
                        return Err(at(rejection));
                    }
                    ended = Some(rejection);
                }
            }
        }
    }
    Ok(())
}

/// Sets start values before Initialization Mode and inputs in it.
fn start(plan: &Plan, instance: &mut Running, room: &mut Room, run: usize) -> Result<(), Rejection> {
    instance.begin(plan.time[0], plan.time.last().copied(), &plan.start, run)?;
    set_values(plan, instance, room, 0)?;
    instance.exit_initialization_mode()
}

#[inline]
fn set_inputs(plan: &Plan, instance: &mut Running, room: &mut Room, time: usize) -> Result<(), Rejection> {
    set_values(plan, instance, room, time)?;
    if room.derivatives.is_empty() {
        return Ok(());
    }
    fill(&mut room.slopes, &room.derivatives, time);
    let references = plan.derivatives.variables.references().unwrap_or_default();
    instance.sole().set_input_derivatives(references, &room.orders, &room.slopes)
}

#[inline]
fn set_values(plan: &Plan, instance: &mut Running, room: &mut Room, time: usize) -> Result<(), Rejection> {
    if room.inputs.is_empty() {
        return Ok(());
    }
    fill(&mut room.set, &room.inputs, time);
    instance.set(&plan.inputs.variables, &room.set)
}

#[inline]
fn fill(buffer: &mut [f64], values: &[ByTime], time: usize) {
    for (slot, values) in buffer.iter_mut().zip(values) {
        *slot = values.at(time);
    }
}
