//! Carries out a plan: threads over instances, each reset from run to run.

use super::Runs;
use super::measure::Measured;
use super::plan::{Inputs, Output, Plan, Values};
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

pub(super) fn run(fmu: &Fmu, plan: &Plan, watch: &Watch) -> Result<Runs, Error> {
    match fmu.description().standard {
        Standard::Fmi2 => on_threads::<Importer>(fmu, plan, watch),
        Standard::Fmi3 => on_threads::<fmi3::Importer>(fmu, plan, watch),
    }
}

/// What a run has to fill.
struct Row<'a> {
    run: usize,
    courses: &'a mut [f64],
    measures: &'a mut [f64],
}

fn on_threads<S: Slave + Send>(fmu: &Fmu, plan: &Plan, watch: &Watch) -> Result<Runs, Error> {
    let kept = plan.every.map_or(0, |every| plan.time.len().div_ceil(every));
    let (course, measured) = (plan.outputs.len() * kept, plan.outputs.len() * plan.measures.len());
    let mut runs = Runs {
        count: plan.runs,
        kept,
        courses: zeros(plan.runs, course)?,
        measures: zeros(plan.runs, measured)?,
        errors: Vec::new(),
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(plan.threads)
        .build()
        .map_err(|error| Error::Fmu(format!("no threads can be made: {error}")))?;
    let rows = split(&mut runs.courses, course).zip(split(&mut runs.measures, measured));
    let rows = rows.take(plan.runs).enumerate();
    let rows = Mutex::new(rows.map(|(run, (courses, measures))| Row { run, courses, measures }));
    let next = || rows.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
    // One instance a thread, whoever takes the next run.
    let found = pool.broadcast(|_| {
        let mut worker = Worker::<S> { fmu, plan, instance: None, scratch: Scratch::of(plan) };
        let mut errors = Vec::new();
        while !watch.is_cancelled()
            && let Some(row) = next()
        {
            let run = row.run;
            if let Err(error) = worker.run(row) {
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
    runs.errors = found.into_iter().flatten().collect();
    runs.errors.sort_unstable_by_key(|(run, _)| *run);
    Ok(runs)
}

fn zeros(runs: usize, each: usize) -> Result<Vec<f64>, Error> {
    let count = runs.checked_mul(each).filter(|count| *count <= isize::MAX as usize / 8);
    let room = count.is_some_and(|count| Vec::<f64>::new().try_reserve_exact(count).is_ok());
    match count {
        Some(count) if room => Ok(vec![0.0; count]),
        _ => Err(Error::Request(format!(
            "{runs} runs of {each} numbers need more memory than there is; take measures, or keep fewer times (every)"
        ))),
    }
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
    scratch: Scratch,
}

struct Scratch {
    inputs: Vec<f64>,
    derivatives: Vec<f64>,
    orders: Vec<i32>,
    reals: Vec<f64>,
    measured: Vec<Measured>,
}

impl Scratch {
    fn of(plan: &Plan) -> Self {
        Self {
            inputs: vec![0.0; plan.real_inputs.references.len()],
            derivatives: vec![0.0; plan.derivatives.references.len()],
            orders: vec![1; plan.derivatives.references.len()],
            reals: vec![0.0; plan.real_outputs.len()],
            measured: vec![Measured::NOTHING; plan.outputs.len()],
        }
    }
}

impl<S: Slave> Worker<'_, S> {
    fn run(&mut self, row: Row) -> Result<(), String> {
        let instance = self.instance()?;
        let Row { run, courses, measures } = row;
        let done = follow(self.plan, &instance, &mut self.scratch, run, courses);
        let done = done.and_then(|()| instance.terminate().map_err(|refusal| (None, refusal)));
        let Err((time, refusal)) = done else {
            for (measured, row) in
                self.scratch.measured.iter().zip(measures.chunks_mut(self.plan.measures.len().max(1)))
            {
                for (value, measure) in row.iter_mut().zip(self.plan.measures) {
                    *value = measured.measure(*measure);
                }
            }
            self.instance = Some(instance);
            return Ok(());
        };
        courses.fill(f64::NAN);
        measures.fill(f64::NAN);
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
    scratch: &mut Scratch,
    run: usize,
    courses: &mut [f64],
) -> Result<(), Refused> {
    let (first, last) = (plan.time[0], plan.time[plan.time.len() - 1]);
    start(plan, instance, scratch, run, first, last).map_err(|refusal| (None, refusal))?;
    scratch.measured.fill(Measured::NOTHING);
    let measures = !plan.measures.is_empty();
    let every = plan.every.unwrap_or(usize::MAX);
    let kept = plan.every.map_or(0, |every| plan.time.len().div_ceil(every));
    let (mut until_kept, mut place) = (0, 0);
    for (k, &time) in plan.time.iter().enumerate() {
        let at = |refusal| (Some(time), refusal);
        if !plan.read_before_set {
            set_inputs(plan, instance, scratch, run, k).map_err(at)?;
        }
        let keep = until_kept == 0 && plan.every.is_some();
        if keep || measures {
            if !plan.real_outputs.is_empty() {
                instance.get_reals(&plan.real_outputs, &mut scratch.reals).map_err(at)?;
            }
            for (number, output) in plan.outputs.iter().enumerate() {
                let value = match *output {
                    Output::Real(place) => scratch.reals[place],
                    Output::Other(base, reference) => instance.get_number(base, reference).map_err(at)?,
                };
                if keep {
                    courses[number * kept + place] = value;
                }
                if measures {
                    scratch.measured[number].add(time, value);
                }
            }
        }
        if keep {
            place += 1;
            until_kept = every;
        }
        until_kept -= 1;
        if plan.read_before_set {
            set_inputs(plan, instance, scratch, run, k).map_err(at)?;
        }
        if let Some(next) = plan.time.get(k + 1) {
            instance.step(time, next - time).map_err(at)?;
        }
    }
    Ok(())
}

/// Start values before the initialization, inputs in it: so both editions of the standard allow it.
fn start<S: Slave>(
    plan: &Plan,
    instance: &S,
    scratch: &mut Scratch,
    run: usize,
    first: f64,
    last: f64,
) -> Result<(), Refusal> {
    instance.set_up(first, last)?;
    for (reference, text) in &plan.texts {
        instance.set_text(*reference, text)?;
    }
    set_others(instance, &plan.start, run, 0)?;
    instance.initialize(first, last)?;
    set_values(plan, instance, scratch, run, 0)?;
    instance.initialized()
}

#[inline]
fn set_inputs<S: Slave>(
    plan: &Plan,
    instance: &S,
    scratch: &mut Scratch,
    run: usize,
    time: usize,
) -> Result<(), Refusal> {
    set_values(plan, instance, scratch, run, time)?;
    let Inputs { references, values } = &plan.derivatives;
    if references.is_empty() {
        return Ok(());
    }
    fill(&mut scratch.derivatives, values, run, time);
    instance.set_input_derivatives(references, &scratch.orders, &scratch.derivatives)
}

#[inline]
fn set_values<S: Slave>(
    plan: &Plan,
    instance: &S,
    scratch: &mut Scratch,
    run: usize,
    time: usize,
) -> Result<(), Refusal> {
    let Inputs { references, values } = &plan.real_inputs;
    if !references.is_empty() {
        fill(&mut scratch.inputs, values, run, time);
        instance.set_reals(references, &scratch.inputs)?;
    }
    set_others(instance, &plan.other_inputs, run, time)
}

#[inline]
fn fill(buffer: &mut [f64], values: &[Values], run: usize, time: usize) {
    for (slot, values) in buffer.iter_mut().zip(values) {
        *slot = values.at(run, time);
    }
}

#[inline]
fn set_others<S: Slave>(
    instance: &S,
    others: &[(BaseType, u32, Values)],
    run: usize,
    time: usize,
) -> Result<(), Refusal> {
    others.iter().try_for_each(|(base, reference, values)| {
        instance.set_number(*base, *reference, values.at(run, time))
    })
}
