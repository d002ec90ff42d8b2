//! Checks that saved states are complete.
//!
//! After `memory in` of `variables!`, a model lists the fields that its saved states must contain. The compiler cannot detect that a
//! field is missing in this list. So the model is simulated, some of its saved states are read into another instance, and this instance
//! must have the same results as the first one when both continue with the same inputs.

use crate::check::Starts;
use crate::instance::{Instance, Outcome, Saved};
use crate::model::LoadedModel;
use crate::sample::{draw_value, is_finite};
use crate::table::Variable;
use anyhow::{Result, bail};
use fmi_abi::{BaseType, Causality, Interface, Standard, Value, Variability};

/// The steps, counted from 0, before which states are saved.
const SAVED_BEFORE: [usize; 5] = [0, 1, 2, 5, 12];
/// Number of steps that are compared after each saved state.
const FOLLOWED: usize = 8;
/// Number of steps in a simulation. One simulation uses the default step size. If it ends before the default experiment, and the model
/// allows other step sizes, a second simulation has longer steps and reaches the end of the experiment.
const STEPS: usize = SAVED_BEFORE[SAVED_BEFORE.len() - 1] + FOLLOWED;
/// Tolerance relative to the largest value of a variable. A smaller difference may be a rounding error, because a model may calculate
/// differently after its state was read.
const TOLERANCE: f64 = 1e-6;

/// Rejects a model whose saved states are incomplete.
pub(crate) fn check(model: &LoadedModel, starts: &Starts) -> Result<()> {
    let table = &model.table;
    let info = &table.info;
    let variable = table.co_simulation.as_ref().is_none_or(|offer| offer.variable_step_size);
    let size_to_end = (info.stop_time - info.start_time) / STEPS as f64;
    let sizes = [Some(info.step_size), Some(size_to_end).filter(|size| *size > info.step_size && variable)];
    let inputs = inputs(model, starts);
    // Both times differ from the defaults of a new instance, so that a saved state without them is detected.
    let start_time = info.start_time + info.step_size;
    let stop_time = start_time + f64::max(size_to_end, info.step_size) * STEPS as f64;
    for interface in table.interfaces() {
        let with_rates = table.input_derivatives && interface == Interface::CoSimulation;
        for size in sizes.into_iter().flatten() {
            for rates in [false, true].into_iter().take(1 + usize::from(with_rates)) {
                let times = [start_time, stop_time];
                Simulation { model, interface, times, size, variable, inputs: &inputs, rates }.run()?;
            }
        }
    }
    Ok(())
}

/// The input values that are set before each step, by index. They are near the start values, the same in every simulation, and
/// constant after the first steps.
type Inputs = Vec<Starts>;

fn inputs(model: &LoadedModel, starts: &Starts) -> Inputs {
    let mut random = fastrand::Rng::with_seed(3);
    let variables = &model.table.variables;
    let mut now = starts.clone();
    let mut draw = || {
        let mut drawn = vec![None; variables.len()];
        for (index, variable) in
            variables.iter().enumerate().filter(|(_, variable)| variable.causality == Causality::Input)
        {
            let Some(start) = &starts[index] else { continue };
            drawn[index] = draw_value(&mut random, &variable.variable_type, start, now[index].as_ref(), 1.0);
            now[index] = drawn[index].clone().or(now[index].take());
        }
        drawn
    };
    let mut all: Inputs = std::iter::repeat_with(&mut draw).take(1 + SAVED_BEFORE[3]).collect();
    all.resize(STEPS, all[SAVED_BEFORE[3]].clone());
    all
}

/// The values of all variables; in Model Exchange, followed by the event indicators and the nominal values of the states.
type Values = Vec<Value>;

fn values(instance: &mut Instance) -> Values {
    let mut values = instance.values();
    if instance.interface == Interface::ModelExchange {
        values.extend(instance.indicators_and_nominals().into_iter().map(Value::Real));
    }
    values
}

/// A simulation whose saved states are checked.
struct Simulation<'a> {
    model: &'a LoadedModel,
    interface: Interface,
    /// Start and stop time.
    times: [f64; 2],
    size: f64,
    /// Whether steps may have any size.
    variable: bool,
    inputs: &'a Inputs,
    /// Whether the importer sets time derivatives of inputs.
    rates: bool,
}

/// A state that was saved before a step, and the values that were read then.
struct Point {
    step: usize,
    saved: Saved,
    values: Values,
}

impl<'a> Simulation<'a> {
    fn run(&self) -> Result<()> {
        // A rejected call is not an error here.
        let Ok(mut instance) = self.initialized() else { return Ok(()) };
        let mut points: Vec<Point> = Vec::new();
        let mut trajectory: Vec<Values> = Vec::new();
        for step in 0..STEPS {
            self.model.monitor.progress("simulates the model to test its saved states", step, STEPS);
            let _ = self.set(&mut instance, step);
            if SAVED_BEFORE.contains(&step)
                && let Ok(saved) = instance.save()
            {
                points.push(Point { step, saved, values: values(&mut instance) });
            }
            let Some(values) = self.step(&mut instance, step) else { break };
            trajectory.push(values);
        }
        let mut scales = vec![0.0; values(&mut instance).len()];
        for values in points.iter().map(|point| &point.values).chain(&trajectory) {
            for (scale, value) in scales.iter_mut().zip(values) {
                if let Value::Real(value) = value {
                    *scale = f64::max(*scale, value.abs());
                }
            }
        }
        for point in &points {
            let Ok(bytes) = instance.serialize(point.saved) else { continue };
            let Ok(mut other) = self.instance() else { continue };
            let consequence = match other.deserialize(&bytes, point.saved.time) {
                Ok(()) => self.difference(point, &mut instance, &mut other, &trajectory, &scales),
                Err(message) => Some(format!("it is rejected: {message}")),
            };
            if let Some(consequence) = consequence {
                bail!(
                    "saved states lack something that {} remembers: read into another instance after {} steps of {} s \
                     in {}, {consequence}; name every field that initialize, a step or an event changes after `memory \
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

    /// Creates an instance. It is one of FMI 2.0 if derivatives of inputs are set, because FMI 3.0 does not have them.
    fn instance(&self) -> Outcome<Instance<'a>> {
        let standard = if self.rates { Standard::Fmi2 } else { Standard::Fmi3 };
        Instance::new(self.model, self.interface, standard, false)
    }

    /// Creates an instance and initializes it, up to the first step.
    fn initialized(&self) -> Outcome<Instance<'a>> {
        let mut instance = self.instance()?;
        let [start, stop] = self.times;
        instance.initialize(start, Some(stop), Some(self.model.table.info.tolerance))?;
        instance.initialized()?;
        Ok(instance)
    }

    /// Returns the name of a value in [`Values`].
    fn name(&self, number: usize) -> String {
        let table = &self.model.table;
        match number.checked_sub(table.variables.len()) {
            None => table.variables[number].name.clone(),
            Some(number) if number < table.indicators() => format!("event indicator {number}"),
            Some(number) => {
                let (state, _) = table.states[number - table.indicators()];
                format!("the nominal value of {}", table.name(state))
            }
        }
    }

    /// Describes how the instance `other` differs from the instance whose state it has read; `None` if they agree, if the results of the
    /// model are random, or if a state cannot be saved or restored.
    fn difference(
        &self,
        point: &Point,
        own: &mut Instance,
        other: &mut Instance,
        trajectory: &[Values],
        scales: &[f64],
    ) -> Option<String> {
        let read = other.save().ok()?;
        // An importer may set the inputs of the next step only before it saves the state, or also after it restores the state.
        [false, true].into_iter().find_map(|sets_again| {
            other.restore(read).ok()?;
            let (steps, numbers) = self.first_difference(other, point, sets_again, trajectory, scales)?;
            own.restore(point.saved).ok()?;
            // A model with random results differs even if the same instance repeats the steps.
            if self.first_difference(own, point, sets_again, trajectory, scales).is_some() {
                return None;
            }
            let names: Vec<_> = numbers.into_iter().map(|number| self.name(number)).collect();
            let when = if steps == 0 { "immediately".to_owned() } else { format!("after {steps} more") };
            Some(format!("values differ {when}: {}", names.join(", ")))
        })
    }

    /// Continues from a point. Returns the number of steps after which values first differ from the trajectory, and the indices of
    /// these values; `None` if they agree. With `sets_again`, also sets the inputs of the first step.
    fn first_difference(
        &self,
        instance: &mut Instance,
        point: &Point,
        sets_again: bool,
        trajectory: &[Values],
        scales: &[f64],
    ) -> Option<(usize, Vec<usize>)> {
        let trajectory = trajectory.iter().skip(point.step).take(FOLLOWED);
        for (steps, expected) in std::iter::once(&point.values).chain(trajectory).enumerate() {
            if steps > usize::from(!sets_again) {
                let _ = self.set(instance, point.step + steps - 1);
            }
            if steps > 0 {
                self.step(instance, point.step + steps - 1);
            }
            let found = values(instance);
            let pairs = expected.iter().zip(&found).zip(scales).enumerate();
            let different = pairs.filter(|(_, ((expected, found), scale))| differ(expected, found, **scale));
            let different: Vec<_> = different.map(|(number, _)| number).collect();
            if !different.is_empty() {
                return Some((steps, different));
            }
        }
        None
    }

    /// Sets the inputs before a step; in Model Exchange, in Event Mode. Inputs that the model rejects keep their values.
    fn set(&self, instance: &mut Instance, step: usize) -> Outcome {
        let inputs = &self.inputs[step];
        if self.interface == Interface::ModelExchange {
            instance.enter_event_mode()?;
        }
        instance.set(inputs, |_| true)?;
        let variables = &self.model.table.variables;
        let rate = |(index, variable): (u32, &Variable)| match inputs[index as usize] {
            Some(Value::Real(value)) if variable.variability == Variability::Continuous => {
                Some((index, value))
            }
            _ => None,
        };
        let is_set = |variable: &Variable| self.rates && variable.base() == BaseType::Real;
        let rates = (0..).zip(variables).filter(|(_, variable)| is_set(variable)).filter_map(rate);
        let (indices, rates): (Vec<u32>, Vec<f64>) = rates.unzip();
        instance.set_input_derivatives(&indices, &rates)
    }

    /// Does a step and returns the values after it; `None` if the model rejects the step or ends the simulation, or if a value is not
    /// finite.
    fn step(&self, instance: &mut Instance, step: usize) -> Option<Values> {
        let size = if self.variable && step % 3 == 1 { 0.5 * self.size } else { self.size };
        let continues = match self.interface {
            Interface::CoSimulation => instance.step(size),
            Interface::ModelExchange => integrate(instance, size),
        };
        if !continues.ok()? {
            return None;
        }
        let values = values(instance);
        values.iter().all(is_finite).then_some(values)
    }
}

/// Handles an event, then does a step with Euler's method.
fn integrate(instance: &mut Instance, size: f64) -> Outcome<bool> {
    instance.enter_event_mode()?;
    instance.handle_event()?;
    let states = instance.states()?.into_iter().zip(instance.derivatives()?);
    let states: Vec<f64> = states.map(|(state, derivative)| state + size * derivative).collect();
    instance.set_time(instance.time + size)?;
    instance.set_states(&states)?;
    instance.step_completed()?;
    Ok(true)
}

fn differ(expected: &Value, found: &Value, scale: f64) -> bool {
    match (expected, found) {
        (Value::Real(expected), Value::Real(found)) => {
            found.is_nan() || (expected - found).abs() > TOLERANCE * scale
        }
        _ => expected != found,
    }
}
