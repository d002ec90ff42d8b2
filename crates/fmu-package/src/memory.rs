//! Whether a saved state holds all that a model remembers.
//!
//! The compiler cannot see that a field is missing in the `memory` of [`variables!`](fmu_export::variables): saved states
//! would silently lack it. So the model is simulated, now and then read into another instance from what is saved of it,
//! and both go on with the same inputs.

use crate::check::{Starts, interfaces};
use crate::sample::draw_value;
use anyhow::{Result, bail};
use fmu_export::{
    Causality, Error, Event, Events, Experiment, Exported, Interface, Setup, StateOfTable, StateVisitor,
    Step, Stepped, Value, Variability,
};
use std::collections::VecDeque;

/// The steps, counted from 0, before which states are saved, and how many of them follow each.
const SAVED_BEFORE: [usize; 5] = [0, 1, 2, 5, 12];
const FOLLOWED: usize = 8;
/// Steps of the default size, and as many that reach the end of the default experiment.
const STEPS: usize = SAVED_BEFORE[SAVED_BEFORE.len() - 1] + FOLLOWED;
/// Of the largest value of a variable: less may be rounding, if the model calculates in another way where it has just been
/// read.
const TOLERANCE: f64 = 1e-6;
/// Events in one step, or rounds of one: a model that needs more is not judged.
const MOST_EVENTS: usize = 100;

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
type Inputs = Vec<Vec<(usize, Value)>>;

fn inputs<M: Exported>(starts: &Starts) -> Inputs {
    let mut random = fastrand::Rng::with_seed(3);
    let mut now = starts.clone();
    let mut draw = || {
        let inputs = M::TABLE.iter().enumerate().filter(|(_, of)| of.causality() == Causality::Input);
        let drawn = inputs.filter_map(|(place, of)| {
            let value = draw_value(&mut random, of.of(), starts[place].as_ref()?, now[place].as_ref())?;
            now[place] = Some(value.clone());
            Some((place, value))
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

/// A model that somebody simulates.
#[derive(Clone)]
struct Run<M> {
    model: M,
    time: f64,
}

/// A run before a step, and what was read there.
struct Point<M> {
    step: usize,
    run: Run<M>,
    values: Values,
}

impl Rehearsal<'_> {
    fn run<M: Exported>(&self) -> Result<()> {
        // What the model refuses, it is not judged by.
        let Some(mut run) = self.initialized::<M>() else { return Ok(()) };
        let mut saved: Vec<Point<M>> = Vec::new();
        let mut path: Vec<Values> = Vec::new();
        for step in 0..STEPS {
            self.set(&mut run, step);
            if SAVED_BEFORE.contains(&step) {
                saved.push(Point { step, run: run.clone(), values: self.values(&run) });
            }
            if self.step(&mut run, step).is_none() {
                break;
            }
            path.push(self.values(&run));
        }
        let mut scales = vec![0.0; self.values(&run).len()];
        for (scale, value) in saved.iter().map(|point| &point.values).chain(&path).flat_map(scales_of) {
            scales[scale] = f64::max(scales[scale], value);
        }
        for point in &saved {
            let consequence = match self.read_back(&point.run) {
                Ok(other) => self.difference(point, &other, &path, &scales),
                Err(error) if point.run.model.clone().update().is_ok() => {
                    Some(format!("it is refused: {error}"))
                }
                Err(_) => None,
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

    /// As an importer has it before the first step.
    fn initialized<M: Exported>(&self) -> Option<Run<M>> {
        let mut model = M::new(&Setup::new(self.interface)).ok()?;
        model.initialize(&self.experiment).ok()?;
        let mut run = Run { model, time: self.experiment.start_time };
        if M::CO_SIMULATION.is_some_and(|offer| offer.events == Events::Stop) {
            run.handle_event()?;
        }
        Some(run)
    }

    /// Another instance that has read what is saved of this one.
    fn read_back<M: Exported>(&self, run: &Run<M>) -> Result<Run<M>, Error> {
        let mut tape = Tape { values: VecDeque::new(), reading: false };
        run.model.clone().visit_state(&mut tape);
        tape.reading = true;
        let mut model = M::new(&Setup::new(self.interface))?;
        model.visit_state(&mut tape);
        model.update()?;
        model.calculate(run.time);
        Ok(Run { model, time: run.time })
    }

    /// How another instance goes on otherwise than the one whose state it has read.
    fn difference<M: Exported>(
        &self,
        from: &Point<M>,
        other: &Run<M>,
        path: &[Values],
        scales: &[f64],
    ) -> Option<String> {
        // Importers set the inputs of the next step before they save, or after they have read.
        [false, true].into_iter().find_map(|again| {
            let (steps, places) = self.first_difference(other.clone(), from, again, path, scales)?;
            // A model that plays dice differs from its own copy as well.
            if self.first_difference(from.run.clone(), from, again, path, scales).is_some() {
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
        mut run: Run<M>,
        from: &Point<M>,
        again: bool,
        path: &[Values],
        scales: &[f64],
    ) -> Option<(usize, Vec<usize>)> {
        let path = path.iter().skip(from.step).take(FOLLOWED);
        for (steps, expected) in std::iter::once(&from.values).chain(path).enumerate() {
            if steps > usize::from(!again) {
                self.set(&mut run, from.step + steps - 1);
            }
            if steps > 0 {
                self.step(&mut run, from.step + steps - 1);
            }
            let found = self.values(&run);
            let pairs = expected.iter().zip(&found).zip(scales).enumerate();
            let different = pairs.filter(|(_, ((expected, found), scale))| differ(expected, found, **scale));
            let different: Vec<_> = different.map(|(place, _)| place).collect();
            if !different.is_empty() {
                return Some((steps, different));
            }
        }
        None
    }

    /// What an importer sets before a step.
    fn set<M: Exported>(&self, run: &mut Run<M>, step: usize) {
        for (place, value) in &self.inputs[step] {
            let of = &M::TABLE[*place];
            of.set(&mut run.model, value);
            if let Value::Real(value) = value
                && self.rates
                && of.variability() == Variability::Continuous
            {
                run.model.exported_input_derivative(M::NAMES[*place], 1, *value);
            }
        }
        run.model.calculate(run.time);
    }

    /// A step; `None` if the model refuses it, or ends the simulation.
    fn step<M: Exported>(&self, run: &mut Run<M>, step: usize) -> Option<()> {
        let uneven = M::CO_SIMULATION.is_none_or(|offer| offer.variable_step_size) && step % 3 == 1;
        let size = if uneven { 0.5 * self.size } else { self.size };
        match self.interface {
            Interface::CoSimulation => run.advance(size)?,
            Interface::ModelExchange => run.integrate(size)?,
        }
        run.model.calculate(run.time);
        let is_finite =
            |value: &Option<Value>| !matches!(value, Some(Value::Real(value)) if !value.is_finite());
        self.values(run).iter().all(is_finite).then_some(())
    }

    fn values<M: Exported>(&self, run: &Run<M>) -> Values {
        let mut values: Values = M::TABLE.iter().map(|of| of.value(&run.model)).collect();
        if let Some(offer) = M::MODEL_EXCHANGE.filter(|_| self.interface == Interface::ModelExchange) {
            let mut more = vec![0.0; offer.indicators];
            run.model.exported_indicators(&mut more);
            let state = |of: &StateOfTable| M::TABLE[of.state as usize].of().nominal_or_one();
            let mut nominals: Vec<f64> = M::STATES.iter().map(state).collect();
            run.model.exported_nominals(&mut nominals);
            values.extend(more.into_iter().chain(nominals).map(|value| Some(Value::Real(value))));
        }
        values
    }
}

impl<M: Exported> Run<M> {
    /// A step of Co-Simulation as importers have it that handle no events.
    fn advance(&mut self, size: f64) -> Option<()> {
        let stop_at_events = M::CO_SIMULATION.is_some_and(|offer| offer.events == Events::Stop);
        let end = self.time + size;
        for _ in 0..MOST_EVENTS {
            let step = Step { time: self.time, size: end - self.time, stop_at_events };
            match self.model.exported_step(step).ok()? {
                Stepped::Done => {
                    self.time = end;
                    return Some(());
                }
                Stepped::Early(time) => {
                    self.time = time;
                    return Some(());
                }
                Stepped::Event(time) => {
                    self.time = time;
                    self.handle_event()?;
                    if time >= end {
                        return Some(());
                    }
                }
                Stepped::Terminate(_) => return None,
            }
        }
        None
    }

    /// A step of Model Exchange by Euler's rule, with an event at its begin.
    fn integrate(&mut self, size: f64) -> Option<()> {
        self.handle_event()?;
        self.model.exported_continuous_time_entered();
        self.model.calculate(self.time);
        let value = |place: u32| M::TABLE[place as usize].value(&self.model);
        let change = |state: &StateOfTable| match (value(state.state), value(state.derivative)) {
            (Some(Value::Real(x)), Some(Value::Real(rate))) => Some(Value::Real(x + size * rate)),
            _ => None,
        };
        let states = M::STATES.iter().map(change).collect::<Option<Vec<_>>>()?;
        self.time += size;
        for (state, value) in M::STATES.iter().zip(states) {
            M::TABLE[state.state as usize].set(&mut self.model, &value);
        }
        if M::MODEL_EXCHANGE.is_some_and(|offer| offer.step_completed) {
            self.model.calculate(self.time);
            self.model.exported_step_completed(self.time);
        }
        Some(())
    }

    fn handle_event(&mut self) -> Option<()> {
        for _ in 0..MOST_EVENTS {
            self.model.calculate(self.time);
            match self.model.exported_event(self.time).ok()? {
                Event { terminate: true, .. } => return None,
                Event { again: true, .. } => {}
                _ => return Some(()),
            }
        }
        None
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

/// What is saved, in its order.
struct Tape {
    values: VecDeque<Value>,
    reading: bool,
}

impl Tape {
    /// Keeps the value; or tells the one that was kept in its place.
    fn pass(&mut self, value: Value) -> Value {
        if !self.reading {
            self.values.push_back(value.clone());
            return value;
        }
        self.values.pop_front().unwrap_or(value)
    }
}

impl StateVisitor for Tape {
    fn real(&mut self, value: &mut f64) {
        if let Value::Real(kept) = self.pass(Value::Real(*value)) {
            *value = kept;
        }
    }
    fn integer(&mut self, value: &mut i64) {
        if let Value::Integer(kept) = self.pass(Value::Integer((*value).into())) {
            *value = kept as i64;
        }
    }
    fn boolean(&mut self, value: &mut bool) {
        if let Value::Boolean(kept) = self.pass(Value::Boolean(*value)) {
            *value = kept;
        }
    }
    fn text(&mut self, value: &mut String) {
        if let Value::String(kept) = self.pass(Value::String(value.clone())) {
            *value = kept;
        }
    }
    fn length(&mut self, value: &mut usize) {
        if let Value::Integer(kept) = self.pass(Value::Integer(*value as i128)) {
            *value = kept as usize;
        }
    }
    fn invalid(&mut self) {}
}
