//! Carries out a plan: threads over instances, each reset from run to run.

use super::measure::Measured;
use super::plan::{ByTime, Plan, Values};
use super::slave::{Refusal, Slave};
use crate::description::Standard;
use crate::error::Error;
use crate::fmu::Fmu;
use crate::{Importer, fmi3};
use fmu_export::BaseType;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// How the caller of [`Fmu::run`] looks on from another thread.
#[derive(Debug, Default)]
pub struct Watch {
    done: AtomicUsize,
    cancelled: AtomicBool,
}

impl Watch {
    /// How many runs are done, refused ones among them.
    pub fn done(&self) -> usize {
        self.done.load(Ordering::Relaxed)
    }

    /// No run begins any more.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

/// Fills the courses and the measures; returns the refused runs.
pub(super) fn run(
    fmu: &Fmu,
    plan: &Plan,
    watch: &Watch,
    into: [&mut [f64]; 2],
) -> Result<Vec<(usize, String)>, Error> {
    match fmu.description().standard {
        Standard::Fmi2 => on_threads::<Importer>(fmu, plan, watch, into),
        Standard::Fmi3 => on_threads::<fmi3::Importer>(fmu, plan, watch, into),
    }
}

/// What a run has to fill.
struct Row<'a> {
    run: usize,
    courses: &'a mut [f64],
    measures: &'a mut [f64],
}

fn on_threads<S: Slave + Send>(
    fmu: &Fmu,
    plan: &Plan,
    watch: &Watch,
    [courses, measures]: [&mut [f64]; 2],
) -> Result<Vec<(usize, String)>, Error> {
    let (course, measured) = (plan.outputs * plan.kept(), plan.outputs * plan.measures.len());
    let room = courses.len() >= plan.runs * course && measures.len() >= plan.runs * measured;
    assert!(room, "there is too little room for {} runs", plan.runs);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(plan.threads)
        .build()
        .map_err(|error| Error::Fmu(format!("no threads can be made: {error}")))?;
    let rows = split(courses, course).zip(split(measures, measured));
    let rows = rows.take(plan.runs).enumerate();
    let rows = Mutex::new(rows.map(|(run, (courses, measures))| Row { run, courses, measures }));
    let next = || rows.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
    // One instance a thread, whoever takes the next run.
    let found = pool.broadcast(|_| {
        let mut worker = Worker::<S> { fmu, plan, instance: None, room: Room::of(plan) };
        let mut errors = Vec::new();
        while !watch.is_cancelled()
            && let Some(row) = next()
        {
            let Row { run, courses, measures } = row;
            if let Err(error) = worker.run(run, courses, measures) {
                courses.fill(f64::NAN);
                measures.fill(f64::NAN);
                errors.push((run, error));
            }
            watch.done.fetch_add(1, Ordering::Relaxed);
        }
        errors
    });
    drop(rows);
    if watch.is_cancelled() && watch.done() < plan.runs {
        return Err(Error::Cancelled);
    }
    let mut errors: Vec<_> = found.into_iter().flatten().collect();
    errors.sort_unstable_by_key(|(run, _)| *run);
    Ok(errors)
}

/// Parts of the same length, of which there are enough also when that is 0.
fn split(values: &mut [f64], length: usize) -> impl Iterator<Item = &mut [f64]> {
    let mut rest = values;
    std::iter::repeat_with(move || {
        let (part, after) = std::mem::take(&mut rest).split_at_mut_checked(length).unwrap_or_default();
        rest = after;
        part
    })
}

/// A thread's instance, and room for what goes to and fro.
struct Worker<'a, S> {
    fmu: &'a Fmu,
    plan: &'a Plan<'a>,
    instance: Option<S>,
    room: Room<'a>,
}

struct Room<'a> {
    /// What the inputs of this run do.
    inputs: Vec<ByTime<'a>>,
    derivatives: Vec<ByTime<'a>>,
    others: Vec<(BaseType, u32, ByTime<'a>)>,
    /// What goes to the FMU in one call, and comes from it.
    set: Vec<f64>,
    slopes: Vec<f64>,
    orders: Vec<i32>,
    got: Vec<f64>,
    /// The outputs of a time, in their order.
    row: Vec<f64>,
    measured: Measured,
}

impl<'a> Room<'a> {
    fn of(plan: &Plan<'a>) -> Self {
        Self {
            inputs: Vec::new(),
            derivatives: Vec::new(),
            others: Vec::new(),
            set: vec![0.0; plan.real_inputs.references.len()],
            slopes: vec![0.0; plan.derivatives.references.len()],
            orders: vec![1; plan.derivatives.references.len()],
            got: vec![0.0; plan.real_outputs.0.len()],
            row: vec![0.0; plan.outputs],
            measured: Measured::new(plan.measures, plan.outputs),
        }
    }

    fn begin(&mut self, plan: &Plan<'a>, run: usize) {
        let of_run = |values: &Vec<Values<'a>>| values.iter().map(|values| values.of_run(run)).collect();
        self.inputs = of_run(&plan.real_inputs.values);
        self.derivatives = of_run(&plan.derivatives.values);
        let others = plan.other_inputs.iter();
        self.others =
            others.map(|(base, reference, values)| (*base, *reference, values.of_run(run))).collect();
        self.measured.begin();
    }
}

impl<S: Slave> Worker<'_, S> {
    fn run(&mut self, run: usize, courses: &mut [f64], measures: &mut [f64]) -> Result<(), String> {
        let instance = self.instance()?;
        self.room.begin(self.plan, run);
        let done = follow(self.plan, &instance, &mut self.room, run, courses);
        let done = done.and_then(|()| instance.terminate().map_err(|refusal| (None, refusal)));
        let Err((time, refusal)) = done else {
            for (output, row) in measures.chunks_mut(self.plan.measures.len().max(1)).enumerate() {
                for (value, measure) in row.iter_mut().zip(self.plan.measures) {
                    *value = self.room.measured.measure(*measure, output);
                }
            }
            self.instance = Some(instance);
            return Ok(());
        };
        match refusal.is_fatal() {
            // Not even its memory may be given back.
            true => std::mem::forget(instance),
            false => self.instance = Some(instance),
        }
        Err(match time {
            Some(time) => format!("at {time} s: {refusal}"),
            None => refusal.to_string(),
        })
    }

    /// An instance as new.
    fn instance(&mut self) -> Result<S, String> {
        if let Some(used) = self.instance.take()
            && used.reset().is_ok()
        {
            return Ok(used);
        }
        // Some FMUs cannot be reset. The old instance is gone by now: there may be one at a time only.
        S::instantiate(self.fmu)
    }
}

type Refused = (Option<f64>, Refusal);

/// From the start values to the last time.
fn follow<S: Slave>(
    plan: &Plan,
    instance: &S,
    room: &mut Room,
    run: usize,
    courses: &mut [f64],
) -> Result<(), Refused> {
    start(plan, instance, room, run).map_err(|refusal| (None, refusal))?;
    let measures = !plan.measures.is_empty();
    // The places in a course that are filled, and how many times go by until the next is.
    let (kept, mut place, mut wait) = (plan.kept(), 0, 0);
    let times = plan.time;
    for (k, &time) in times.iter().enumerate() {
        let at = |refusal| (Some(time), refusal);
        if !plan.read_before_set {
            set_inputs(plan, instance, room, k).map_err(at)?;
        }
        let keep = wait == 0 && place < kept;
        if keep || measures {
            read(plan, instance, room).map_err(at)?;
        }
        if keep {
            // Not by chunks, whose number would be calculated anew each time.
            for (output, value) in room.row.iter().enumerate() {
                courses[output * kept + place] = *value;
            }
            place += 1;
            wait = plan.every.unwrap_or(1);
        }
        wait = wait.saturating_sub(1);
        if measures {
            room.measured.add(time, &room.row);
        }
        if plan.read_before_set {
            set_inputs(plan, instance, room, k).map_err(at)?;
        }
        if let Some(next) = times.get(k + 1) {
            instance.step(time, next - time).map_err(at)?;
        }
    }
    Ok(())
}

/// Start values before the initialization, inputs in it: so both editions of the standard allow it.
fn start<S: Slave>(plan: &Plan, instance: &S, room: &mut Room, run: usize) -> Result<(), Refusal> {
    let (first, last) = (plan.time[0], plan.time[plan.time.len() - 1]);
    instance.set_up(first, last)?;
    for (reference, text) in &plan.texts {
        instance.set_text(*reference, text)?;
    }
    for (base, reference, values) in &plan.start {
        instance.set_number(*base, *reference, values.of_run(run).at(0))?;
    }
    instance.initialize(first, last)?;
    set_values(plan, instance, room, 0)?;
    instance.initialized()
}

#[inline]
fn set_inputs<S: Slave>(plan: &Plan, instance: &S, room: &mut Room, time: usize) -> Result<(), Refusal> {
    set_values(plan, instance, room, time)?;
    if room.derivatives.is_empty() {
        return Ok(());
    }
    fill(&mut room.slopes, &room.derivatives, time);
    instance.set_input_derivatives(&plan.derivatives.references, &room.orders, &room.slopes)
}

#[inline]
fn set_values<S: Slave>(plan: &Plan, instance: &S, room: &mut Room, time: usize) -> Result<(), Refusal> {
    if !room.inputs.is_empty() {
        fill(&mut room.set, &room.inputs, time);
        instance.set_reals(&plan.real_inputs.references, &room.set)?;
    }
    for (base, reference, values) in &room.others {
        instance.set_number(*base, *reference, values.at(time))?;
    }
    Ok(())
}

#[inline]
fn fill(buffer: &mut [f64], values: &[ByTime], time: usize) {
    for (slot, values) in buffer.iter_mut().zip(values) {
        *slot = values.at(time);
    }
}

/// The outputs into their row.
#[inline]
fn read<S: Slave>(plan: &Plan, instance: &S, room: &mut Room) -> Result<(), Refusal> {
    let (references, places) = &plan.real_outputs;
    if plan.other_outputs.is_empty() {
        return if references.is_empty() { Ok(()) } else { instance.get_reals(references, &mut room.row) };
    }
    if !references.is_empty() {
        instance.get_reals(references, &mut room.got)?;
    }
    for (place, value) in places.iter().zip(&room.got) {
        room.row[*place] = *value;
    }
    for (base, reference, place) in &plan.other_outputs {
        room.row[*place] = instance.get_number(*base, *reference)?;
    }
    Ok(())
}
