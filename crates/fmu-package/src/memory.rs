//! Whether a saved state holds all that a model remembers.
//!
//! The compiler cannot see that a field is missing in the `memory` of `variables!` of fmu-export: saved states
//! would silently lack it. So the model is simulated, now and then read into another instance from what is saved of it,
//! and both go on with the same inputs.

use crate::check::Starts;
use crate::instance::{Instance, Outcome, Saved};
use crate::model::LoadedModel;
use crate::sample::draw_value;
use anyhow::{Result, bail};
use fmi_abi::{Causality, Interface, Standard, Value, Variability};

/// The steps, counted from 0, before which states are saved, and how many of them follow each.
const SAVED_BEFORE: [usize; 5] = [0, 1, 2, 5, 12];
const FOLLOWED: usize = 8;
/// Steps of the default size, and as many that reach the end of the default experiment.
const STEPS: usize = SAVED_BEFORE[SAVED_BEFORE.len() - 1] + FOLLOWED;
/// Of the largest value of a variable: less may be rounding, if the model calculates in another way where it has just been
/// read.
const TOLERANCE: f64 = 1e-6;

/// Refuses a model of whose state something is missing when it is saved.
pub(crate) fn check(model: &LoadedModel, starts: &Starts) -> Result<()> {
    let table = &model.table;
    let of = &table.info;
    let variable = table.co_simulation.as_ref().is_none_or(|offer| offer.variable_step_size);
    let whole = (of.stop_time - of.start_time) / STEPS as f64;
    let sizes = [Some(of.step_size), Some(whole).filter(|size| *size > of.step_size && variable)];
    let inputs = inputs(model, starts);
    // None of these is what a new instance has.
    let start_time = of.start_time + of.step_size;
    let stop_time = start_time + f64::max(whole, of.step_size) * STEPS as f64;
    for interface in table.interfaces() {
        let with_rates = table.input_derivatives && interface == Interface::CoSimulation;
        for size in sizes.into_iter().flatten() {
            for rates in [false, true].into_iter().take(1 + usize::from(with_rates)) {
                let times = [start_time, stop_time];
                Rehearsal { model, interface, times, size, variable, inputs: &inputs, rates }.run()?;
            }
        }
    }
    Ok(())
}

/// What is set before each step: values near the start values, always the same ones; in the end they stand still. By place.
type Inputs = Vec<Starts>;

fn inputs(model: &LoadedModel, starts: &Starts) -> Inputs {
    let mut random = fastrand::Rng::with_seed(3);
    let variables = &model.table.variables;
    let mut now = starts.clone();
    let mut draw = || {
        let mut drawn = vec![None; variables.len()];
        for (place, of) in variables.iter().enumerate().filter(|(_, of)| of.causality == Causality::Input) {
            let Some(start) = &starts[place] else { continue };
            drawn[place] = draw_value(&mut random, &of.of, start, now[place].as_ref(), 1.0);
            now[place] = drawn[place].clone().or(now[place].take());
        }
        drawn
    };
    let mut all: Inputs = std::iter::repeat_with(&mut draw).take(1 + SAVED_BEFORE[3]).collect();
    all.resize(STEPS, all[SAVED_BEFORE[3]].clone());
    all
}

/// What can be read at a point: all variables, then for importers that integrate the event indicators and the nominal values
/// of the states.
type Values = Vec<Value>;

fn values(instance: &mut Instance) -> Values {
    let mut values = instance.values();
    if instance.interface == Interface::ModelExchange {
        values.extend(instance.indicators_and_nominals().into_iter().map(Value::Real));
    }
    values
}

/// A simulation.
struct Rehearsal<'a> {
    model: &'a LoadedModel,
    interface: Interface,
    /// Start and stop time.
    times: [f64; 2],
    size: f64,
    /// Whether steps may have any size.
    variable: bool,
    inputs: &'a Inputs,
    /// Whether the importer knows time derivatives of inputs.
    rates: bool,
}

/// The state before a step, and what was read there.
struct Point {
    step: usize,
    time: f64,
    state: Saved,
    values: Values,
}

impl<'a> Rehearsal<'a> {
    fn run(&self) -> Result<()> {
        // What the model refuses, it is not judged by.
        let Ok(mut trial) = self.initialized() else { return Ok(()) };
        let mut saved: Vec<Point> = Vec::new();
        let mut path: Vec<Values> = Vec::new();
        for step in 0..STEPS {
            let _ = self.set(&mut trial, step);
            if SAVED_BEFORE.contains(&step)
                && let Ok(state) = trial.save()
            {
                saved.push(Point { step, time: trial.time, state, values: values(&mut trial) });
            }
            let Some(values) = self.step(&mut trial, step) else { break };
            path.push(values);
        }
        let mut scales = vec![0.0; values(&mut trial).len()];
        for (scale, value) in saved.iter().map(|point| &point.values).chain(&path).flat_map(scales_of) {
            scales[scale] = f64::max(scales[scale], value);
        }
        for point in &saved {
            let Ok(bytes) = trial.serialize(point.state) else { continue };
            let Ok(mut other) = self.instance() else { continue };
            let consequence = match other.read(&bytes, point.time) {
                Ok(()) => self.difference(point, &mut trial, &mut other, &path, &scales),
                Err(message) => Some(format!("it is refused: {message}")),
            };
            if let Some(consequence) = consequence {
                bail!(
                    "saved states lack something that {} remembers: read into another instance after {} steps of {} s \
                     in {}, {consequence}; name every field that initialize, a step or an event changes behind `memory \
                     in` of variables!",
                    self.model.table.info.name,
                    point.step,
                    Value::Real(self.size),
                    self.interface,
                );
            }
        }
        Ok(())
    }

    /// FMI 3.0 has no derivatives of inputs.
    fn instance(&self) -> Outcome<Instance<'a>> {
        let standard = if self.rates { Standard::Fmi2 } else { Standard::Fmi3 };
        Instance::new(self.model, self.interface, standard, false)
    }

    /// As an importer has it before the first step.
    fn initialized(&self) -> Outcome<Instance<'a>> {
        let mut instance = self.instance()?;
        let [start, stop] = self.times;
        instance.initialize(start, Some(stop), Some(self.model.table.info.tolerance))?;
        instance.initialized()?;
        Ok(instance)
    }

    /// What a value is of.
    fn name(&self, place: usize) -> String {
        let table = &self.model.table;
        match place.checked_sub(table.variables.len()) {
            None => table.variables[place].name.clone(),
            Some(number) if number < table.indicators() => format!("event indicator {number}"),
            Some(number) => {
                let (state, _) = table.states[number - table.indicators()];
                format!("the nominal value of {}", table.name(state))
            }
        }
    }

    /// How another instance goes on otherwise than the one whose state it has read.
    fn difference(
        &self,
        from: &Point,
        own: &mut Instance,
        other: &mut Instance,
        path: &[Values],
        scales: &[f64],
    ) -> Option<String> {
        let read = other.save().ok()?;
        // Importers set the inputs of the next step before they save, or after they have read.
        [false, true].into_iter().find_map(|again| {
            other.restore(read, from.time).ok()?;
            let (steps, places) = self.first_difference(other, from, again, path, scales)?;
            own.restore(from.state, from.time).ok()?;
            // A model that plays dice differs from itself as well.
            if self.first_difference(own, from, again, path, scales).is_some() {
                return None;
            }
            let names: Vec<_> = places.into_iter().map(|place| self.name(place)).collect();
            let when = if steps == 0 { "at once".to_owned() } else { format!("after {steps} more") };
            Some(format!("there are other values {when}: {}", names.join(", ")))
        })
    }

    /// After how many steps values are first others than on the path, and their places.
    fn first_difference(
        &self,
        trial: &mut Instance,
        from: &Point,
        again: bool,
        path: &[Values],
        scales: &[f64],
    ) -> Option<(usize, Vec<usize>)> {
        let path = path.iter().skip(from.step).take(FOLLOWED);
        for (steps, expected) in std::iter::once(&from.values).chain(path).enumerate() {
            if steps > usize::from(!again) {
                let _ = self.set(trial, from.step + steps - 1);
            }
            if steps > 0 {
                self.step(trial, from.step + steps - 1);
            }
            let found = values(trial);
            let pairs = expected.iter().zip(&found).zip(scales).enumerate();
            let different = pairs.filter(|(_, ((expected, found), scale))| differ(expected, found, **scale));
            let different: Vec<_> = different.map(|(place, _)| place).collect();
            if !different.is_empty() {
                return Some((steps, different));
            }
        }
        None
    }

    /// What an importer sets before a step; what the model refuses, stays as it was. In Model Exchange it is an event.
    fn set(&self, trial: &mut Instance, step: usize) -> Outcome {
        let inputs = &self.inputs[step];
        if self.interface == Interface::ModelExchange {
            trial.enter_event_mode()?;
        }
        trial.set(inputs, |_| true)?;
        let variables = &self.model.table.variables;
        let rate = |(place, of): (u32, &crate::table::Variable)| match inputs[place as usize] {
            Some(Value::Real(value)) if of.variability == Variability::Continuous => Some((place, value)),
            _ => None,
        };
        let is_real = |of: &crate::table::Variable| of.base() == fmi_abi::BaseType::Real;
        let rates = (0..).zip(variables).filter(|(_, of)| self.rates && is_real(of)).filter_map(rate);
        let (places, rates): (Vec<u32>, Vec<f64>) = rates.unzip();
        trial.set_input_derivatives(&places, &rates)
    }

    /// The values after a step; `None` if the model refuses it, or ends the simulation.
    fn step(&self, trial: &mut Instance, step: usize) -> Option<Values> {
        let size = if self.variable && step % 3 == 1 { 0.5 * self.size } else { self.size };
        let goes_on = match self.interface {
            Interface::CoSimulation => trial.step(size),
            Interface::ModelExchange => integrate(trial, size),
        };
        if !goes_on.ok()? {
            return None;
        }
        let values = values(trial);
        let is_finite = |value: &Value| !matches!(value, Value::Real(value) if !value.is_finite());
        values.iter().all(is_finite).then_some(values)
    }
}

/// A step by Euler's rule with an event at its begin.
fn integrate(trial: &mut Instance, size: f64) -> Outcome<bool> {
    trial.enter_event_mode()?;
    trial.handle_event()?;
    let states = trial.states()?.into_iter().zip(trial.derivatives()?);
    let states: Vec<f64> = states.map(|(state, derivative)| state + size * derivative).collect();
    trial.set_time(trial.time + size)?;
    trial.set_states(&states)?;
    trial.step_completed()?;
    Ok(true)
}

/// The sizes of the Reals among values, with their places.
fn scales_of(values: &Values) -> impl Iterator<Item = (usize, f64)> {
    values.iter().enumerate().filter_map(|(place, value)| match value {
        Value::Real(value) => Some((place, value.abs())),
        _ => None,
    })
}

fn differ(expected: &Value, found: &Value, scale: f64) -> bool {
    match (expected, found) {
        (Value::Real(expected), Value::Real(found)) => {
            found.is_nan() || (expected - found).abs() > TOLERANCE * scale
        }
        _ => expected != found,
    }
}
