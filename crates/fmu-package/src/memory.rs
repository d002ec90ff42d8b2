//! Whether a saved state holds all that a model remembers.
//!
//! The compiler cannot see that a field is missing in the `memory` of [`variables!`](fmu_export::variables): saved states
//! would silently lack it. So the model is simulated, now and then read into another instance from what is saved of it,
//! and both go on with the same inputs.

use crate::check::{Starts, interfaces};
use crate::sample::draw_value;
use anyhow::{Result, bail};
use fmu_export::{Causality, Experiment, Exported, Interface, SavedTrial, Trial, Value, Variability};

/// The steps, counted from 0, before which states are saved, and how many of them follow each.
const SAVED_BEFORE: [usize; 5] = [0, 1, 2, 5, 12];
const FOLLOWED: usize = 8;
/// Steps of the default size, and as many that reach the end of the default experiment.
const STEPS: usize = SAVED_BEFORE[SAVED_BEFORE.len() - 1] + FOLLOWED;
/// Of the largest value of a variable: less may be rounding, if the model calculates in another way where it has just been
/// read.
const TOLERANCE: f64 = 1e-6;

/// Refuses a model of whose state something is missing when it is saved.
pub(crate) fn check<M: Exported>(starts: &Starts) -> Result<()> {
    let of = M::INFO.default_experiment;
    let variable = M::CO_SIMULATION.is_none_or(|offer| offer.variable_step_size);
    let whole = (of.stop_time - of.start_time) / STEPS as f64;
    let sizes = [Some(of.step_size), Some(whole).filter(|size| *size > of.step_size && variable)];
    let inputs = inputs::<M>(starts);
    // None of these is what a new instance has.
    let start_time = of.start_time + of.step_size;
    let stop_time = Some(start_time + f64::max(whole, of.step_size) * STEPS as f64);
    let experiment = Experiment { start_time, stop_time, tolerance: Some(of.tolerance) };
    for interface in interfaces::<M>() {
        let with_rates = M::INPUT_DERIVATIVES && interface == Interface::CoSimulation;
        for size in sizes.into_iter().flatten() {
            for rates in [false, true].into_iter().take(1 + usize::from(with_rates)) {
                Rehearsal { interface, experiment, size, inputs: &inputs, rates }.run::<M>()?;
            }
        }
    }
    Ok(())
}

/// What is set before each step: values near the start values, always the same ones; in the end they stand still.
type Inputs = Vec<Vec<(u32, Value)>>;

fn inputs<M: Exported>(starts: &Starts) -> Inputs {
    let mut random = fastrand::Rng::with_seed(3);
    let mut now = starts.clone();
    let mut draw = || {
        let inputs = M::TABLE.iter().enumerate().filter(|(_, of)| of.causality() == Causality::Input);
        let drawn = inputs.filter_map(|(place, of)| {
            let value =
                draw_value(&mut random, of.variable_type(), starts[place].as_ref()?, now[place].as_ref())?;
            now[place] = Some(value.clone());
            Some((place as u32, value))
        });
        drawn.collect::<Vec<_>>()
    };
    let mut all: Inputs = std::iter::repeat_with(&mut draw).take(1 + SAVED_BEFORE[3]).collect();
    all.resize(STEPS, all[SAVED_BEFORE[3]].clone());
    all
}

/// What can be read at a point: all variables, then for importers that integrate the event indicators and the nominal values
/// of the states.
type Values = Vec<Option<Value>>;

/// What a value is of.
fn name<M: Exported>(place: usize) -> String {
    let indicators = M::MODEL_EXCHANGE.map_or(0, |offer| offer.indicators);
    match place.checked_sub(M::TABLE.len()) {
        None => M::TABLE[place].name().to_owned(),
        Some(number) if number < indicators => format!("event indicator {number}"),
        Some(number) => {
            let state = M::STATES[number - indicators].state as usize;
            format!("the nominal value of {}", M::TABLE[state].name())
        }
    }
}

/// A simulation.
struct Rehearsal<'a> {
    interface: Interface,
    experiment: Experiment,
    size: f64,
    inputs: &'a Inputs,
    /// Whether the importer knows time derivatives of inputs.
    rates: bool,
}

/// The state before a step, and what was read there.
struct Point {
    step: usize,
    state: SavedTrial,
    values: Values,
}

impl Rehearsal<'_> {
    fn run<M: Exported>(&self) -> Result<()> {
        // What the model refuses, it is not judged by.
        let Some(mut trial) = Trial::<M>::initialized(self.interface, self.experiment) else {
            return Ok(());
        };
        let mut saved: Vec<Point> = Vec::new();
        let mut path: Vec<Values> = Vec::new();
        for step in 0..STEPS {
            self.set(&mut trial, step);
            if SAVED_BEFORE.contains(&step)
                && let Some(state) = trial.save()
            {
                saved.push(Point { step, state, values: trial.values() });
            }
            if self.step(&mut trial, step).is_none() {
                break;
            }
            path.push(trial.values());
        }
        let mut scales = vec![0.0; trial.values().len()];
        for (scale, value) in saved.iter().map(|point| &point.values).chain(&path).flat_map(scales_of) {
            scales[scale] = f64::max(scales[scale], value);
        }
        for point in &saved {
            let consequence = match trial.elsewhere(point.state) {
                Some(Ok(mut other)) => self.difference(point, &mut trial, &mut other, &path, &scales),
                Some(Err(refusal)) => Some(format!("it is refused: {refusal}")),
                None => None,
            };
            if let Some(consequence) = consequence {
                bail!(
                    "saved states lack something that {} remembers: read into another instance after {} steps of {} s \
                     in {}, {consequence}; name every field that initialize, a step or an event changes behind `memory \
                     in` of variables!",
                    M::INFO.name,
                    point.step,
                    Value::Real(self.size),
                    self.interface,
                );
            }
        }
        Ok(())
    }

    /// How another instance goes on otherwise than the one whose state it has read.
    fn difference<M: Exported>(
        &self,
        from: &Point,
        own: &mut Trial<M>,
        other: &mut Trial<M>,
        path: &[Values],
        scales: &[f64],
    ) -> Option<String> {
        let read = other.save()?;
        // Importers set the inputs of the next step before they save, or after they have read.
        [false, true].into_iter().find_map(|again| {
            other.restore(read)?;
            let (steps, places) = self.first_difference(other, from, again, path, scales)?;
            own.restore(from.state)?;
            // A model that plays dice differs from itself as well.
            if self.first_difference(own, from, again, path, scales).is_some() {
                return None;
            }
            let names: Vec<_> = places.into_iter().map(name::<M>).collect();
            let when = if steps == 0 { "at once".to_owned() } else { format!("after {steps} more") };
            Some(format!("there are other values {when}: {}", names.join(", ")))
        })
    }

    /// After how many steps values are first others than on the path, and their places.
    fn first_difference<M: Exported>(
        &self,
        trial: &mut Trial<M>,
        from: &Point,
        again: bool,
        path: &[Values],
        scales: &[f64],
    ) -> Option<(usize, Vec<usize>)> {
        let path = path.iter().skip(from.step).take(FOLLOWED);
        for (steps, expected) in std::iter::once(&from.values).chain(path).enumerate() {
            if steps > usize::from(!again) {
                self.set(trial, from.step + steps - 1);
            }
            if steps > 0 {
                self.step(trial, from.step + steps - 1);
            }
            let found = trial.values();
            let pairs = expected.iter().zip(&found).zip(scales).enumerate();
            let different = pairs.filter(|(_, ((expected, found), scale))| differ(expected, found, **scale));
            let different: Vec<_> = different.map(|(place, _)| place).collect();
            if !different.is_empty() {
                return Some((steps, different));
            }
        }
        None
    }

    /// What an importer sets before a step; what the model refuses, stays as it was.
    fn set<M: Exported>(&self, trial: &mut Trial<M>, step: usize) {
        let inputs = &self.inputs[step];
        let derivative = |(place, value): &(u32, Value)| match value {
            Value::Real(value) if M::TABLE[*place as usize].variability() == Variability::Continuous => {
                Some((*place, *value))
            }
            _ => None,
        };
        let derivatives: Vec<_> = inputs.iter().filter(|_| self.rates).filter_map(derivative).collect();
        trial.set(inputs, &derivatives);
    }

    /// A step; `None` if the model refuses it, or ends the simulation.
    fn step<M: Exported>(&self, trial: &mut Trial<M>, step: usize) -> Option<()> {
        let uneven = M::CO_SIMULATION.is_none_or(|offer| offer.variable_step_size) && step % 3 == 1;
        trial.step(if uneven { 0.5 * self.size } else { self.size })?;
        let is_finite =
            |value: &Option<Value>| !matches!(value, Some(Value::Real(value)) if !value.is_finite());
        trial.values().iter().all(is_finite).then_some(())
    }
}

/// The sizes of the Reals among values, with their places.
fn scales_of(values: &Values) -> impl Iterator<Item = (usize, f64)> {
    values.iter().enumerate().filter_map(|(place, value)| match value {
        Some(Value::Real(value)) => Some((place, value.abs())),
        _ => None,
    })
}

fn differ(expected: &Option<Value>, found: &Option<Value>, scale: f64) -> bool {
    match (expected, found) {
        (Some(Value::Real(expected)), Some(Value::Real(found))) => {
            found.is_nan() || (expected - found).abs() > TOLERANCE * scale
        }
        _ => expected != found,
    }
}
