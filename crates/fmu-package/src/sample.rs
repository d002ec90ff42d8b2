//! Draws the random points at which a model is evaluated.

use crate::check::{Starts, rounded};
use crate::instance::{Instance, Outcome};
use crate::model::LoadedModel;
use crate::table::Variable;
use anyhow::{Result, anyhow};
use fmi_abi::{Causality, Interface, Standard, Value, Variability};
use std::collections::BTreeMap;

/// A point: the values of the variables that are set, the start time, and the interface type.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Point {
    /// By index; `None` for a variable that is not set.
    pub values: Vec<Option<Value>>,
    pub time: f64,
    pub interface: Interface,
}

/// An instance at a point. Samples with the same number `fixed` have the same fixed parameters. If the number `tunable` is the same,
/// too, they also have the same tunable parameters.
pub(crate) struct FactorSample<'a> {
    pub fixed: usize,
    pub tunable: usize,
    pub instance: Instance<'a>,
}

/// A random draw: the point that it changes (a new one without `before`), whether it draws the time, and the variables that it changes.
struct Draw<'d> {
    before: Option<&'d Point>,
    time: bool,
    which: &'d dyn Fn(&Variable) -> bool,
}

/// Draws points.
pub(crate) struct Sampler<'a> {
    /// Whether the instances are at a communication point or in Continuous-Time Mode rather than in Initialization Mode.
    pub running: bool,
    pub model: &'a LoadedModel,
    random: fastrand::Rng,
    starts: Starts,
    tunable_parameters: bool,
    /// The variables of which the model rejects every new value, by index, each with the model's message.
    pub stuck: BTreeMap<u32, String>,
}

/// The largest number of points that are drawn with each [`Reach`].
const ATTEMPTS: usize = 10;
/// The number of reaches. From the third one on, each is smaller than the one before.
const REACHES: usize = 10;

/// The largest change of a variable, as a fraction of the usual change.
#[derive(Clone, Copy)]
struct Reach {
    /// Whether values are drawn around the start values (the first reach) or around the values at the previous point (all others).
    first: bool,
    /// The fraction for each element separately.
    single: f64,
    /// The fraction for a common factor of all elements of an array, which keeps their order.
    common: f64,
}

impl Reach {
    fn of(number: usize) -> Self {
        let halvings = number.saturating_sub(1) as i32;
        let common = if number == 0 { 0.0 } else { 0.5_f64.powi(halvings) };
        Self { first: number == 0, single: 0.25_f64.powi(halvings), common }
    }
}

impl<'a> Sampler<'a> {
    /// Creates a sampler of points near these start values.
    pub fn new(model: &'a LoadedModel, starts: Starts, tunable_parameters: bool) -> Self {
        // The seed is fixed, so that the same model always gets the same description.
        let random = fastrand::Rng::with_seed(2);
        Self { running: false, model, random, starts, tunable_parameters, stuck: BTreeMap::new() }
    }

    /// Returns instances that differ in fixed parameters, in tunable parameters, and in inputs, states and time.
    pub fn factor_samples(&mut self) -> Result<Vec<FactorSample<'a>>> {
        let is_parameter = |variable: &Variable| variable.causality == Causality::Parameter;
        let tunable_parameters = self.tunable_parameters;
        let is_tunable = |variable: &Variable| {
            is_parameter(variable) && (tunable_parameters || variable.variability == Variability::Tunable)
        };
        let mut samples = Vec::new();
        for fixed in 0..8 {
            let (point, _) = self.draw(None, true, |_| true)?;
            for tunable in 0..3 {
                let (point, _) = self.draw(Some(&point), false, is_tunable)?;
                for steps in 0..3 {
                    let (point, instance) =
                        self.draw(Some(&point), true, |variable| !is_parameter(variable))?;
                    let instance = self.make_steps(instance, &point, steps);
                    samples.push(FactorSample { fixed, tunable, instance });
                }
            }
        }
        Ok(samples)
    }

    /// Draws new values for some variables, and a new time if `time` is true, until the model accepts them. The other variables keep
    /// their values. A variable of which the model rejects every new value also keeps its value, and is added to
    /// [`stuck`](Self::stuck).
    pub fn draw(
        &mut self,
        before: Option<&Point>,
        time: bool,
        which: impl Fn(&Variable) -> bool,
    ) -> Result<(Point, Instance<'a>)> {
        let mut point = before.cloned().unwrap_or_else(|| Point {
            values: vec![None; self.model.table.variables.len()],
            time: 0.0,
            interface: self.draw_interface(),
        });
        if time {
            point.time = self.random.f64();
        }
        let draw = Draw { before, time, which: &which };
        for number in 0..REACHES {
            for _ in 0..ATTEMPTS {
                self.move_values(&mut point, &draw, Reach::of(number), &which);
                if let Ok(instance) = self.accepted(&point, &draw) {
                    return Ok((point, instance));
                }
            }
        }
        self.draw_one_by_one(point, &draw)
    }

    /// Changes one variable or array after the other, each within the largest reach in which the model accepts a change.
    fn draw_one_by_one(&mut self, at: Point, draw: &Draw) -> Result<(Point, Instance<'a>)> {
        let table = &self.model.table;
        let values = match draw.before {
            Some(before) => before.values.clone(),
            // Strings and bytes are not changed.
            None => {
                let is_moved = |value: &&Value| !matches!(value, Value::String(_) | Value::Binary(_));
                let starts = table.variables.iter().zip(&self.starts);
                starts
                    .map(|(variable, start)| {
                        start.as_ref().filter(is_moved).filter(|_| variable.is_moved()).cloned()
                    })
                    .collect()
            }
        };
        let mut point = Point { values, ..at };
        let mut instance = self.accepted(&point, draw).map_err(|message| {
            let Point { time, interface, .. } = point;
            anyhow!(
                "the model rejects its own start values in {interface} at t = {time:.3} s, where it is tried: {message}"
            )
        })?;
        for (index, variable) in table.variables.iter().enumerate() {
            let array = table.array(index as u32);
            let whole = array.iter().all(|index| (draw.which)(&table.variables[*index as usize]));
            if !(draw.which)(variable) || whole && variable.element > 0 || !variable.is_moved() {
                continue;
            }
            let moved = index..index + if whole { array.len() } else { 1 };
            let mut message = String::new();
            let reaches = (1..REACHES).map(Reach::of);
            // Elements that cannot change separately may still change together.
            let together = reaches.clone().map(|reach| Reach { single: 0.0, ..reach });
            for reach in reaches.chain(together.filter(|_| moved.len() > 1)) {
                let mut next = point.clone();
                let is_moved = |other: &Variable| {
                    table.variables[moved.clone()].iter().any(|variable| variable.name == other.name)
                };
                self.move_values(&mut next, draw, reach, &is_moved);
                match self.accepted(&next, draw) {
                    Ok(accepted) => {
                        (point, instance) = (next, accepted);
                        message.clear();
                        break;
                    }
                    Err(rejected) => message = rejected,
                }
            }
            if !message.is_empty() {
                self.stuck.insert(index as u32, message);
            }
        }
        Ok((point, instance))
    }

    /// Draws new values for some variables of a point.
    fn move_values(
        &mut self,
        point: &mut Point,
        draw: &Draw,
        reach: Reach,
        which: &dyn Fn(&Variable) -> bool,
    ) {
        let table = &self.model.table;
        let mut share = 0.0;
        for (index, variable) in
            table.variables.iter().enumerate().filter(|(_, variable)| which(variable) && variable.is_moved())
        {
            // In a running model, states can be set even if they have no start values. Zero then replaces the start value.
            let zero = (self.running && variable.state).then_some(&Value::Real(0.0));
            let Some(start) = self.starts[index].as_ref().or(zero) else { continue };
            let before = draw.before.and_then(|before| before.values[index].as_ref());
            let around = before.filter(|_| !reach.first).unwrap_or(start);
            let is_array =
                || table.array(index as u32).iter().all(|index| which(&table.variables[*index as usize]));
            if variable.element == 0 && reach.common > 0.0 {
                share = 2.0 * self.random.f64() - 1.0;
            }
            let around = match reach.common > 0.0 && variable.length() > 1 && is_array() {
                true => &moved_in_common(variable, around, share * reach.common),
                false => around,
            };
            let value = &mut point.values[index];
            *value = draw_value(&mut self.random, variable, around, value.as_ref(), reach.single);
        }
    }

    /// Returns an instance at a point, if the model accepts the point.
    fn accepted(&self, point: &Point, draw: &Draw) -> Outcome<Instance<'a>> {
        // No function sets states in Co-Simulation. So the new values are set only after the first step, when they can no longer
        // change the states.
        let is_held = self.running && !draw.time && point.interface == Interface::CoSimulation;
        match draw.before.filter(|_| is_held) {
            Some(before) => {
                let mut instance = model_at(self.model, before, true, Standard::Fmi3)?;
                instance.set(&point.values, |variable| (draw.which)(variable) && !variable.state)?;
                Ok(instance)
            }
            None => model_at(self.model, point, self.running, Standard::Fmi3),
        }
    }

    /// Draws one of the interface types, because the dependencies must be correct in both.
    fn draw_interface(&mut self) -> Interface {
        let offered: Vec<Interface> = self.model.table.interfaces().collect();
        offered[self.random.usize(..offered.len())]
    }

    /// Does this number of steps in Co-Simulation. If it is a single step, also sets derivatives of the inputs after it. Factors may
    /// depend on both.
    fn make_steps(&self, mut instance: Instance<'a>, point: &Point, steps: usize) -> Instance<'a> {
        if point.interface != Interface::CoSimulation {
            return instance;
        }
        let table = &self.model.table;
        let with_rates = table.input_derivatives && steps == 1;
        if with_rates && let Ok(of_fmi2) = model_at(self.model, point, self.running, Standard::Fmi2) {
            instance = of_fmi2;
        }
        for _ in 0..steps {
            // A model that rejects the step is unchanged.
            if instance.step(table.info.step_size).is_err() {
                break;
            }
        }
        if with_rates {
            let inputs = table.find(|variable| {
                variable.causality == Causality::Input && variable.variability == Variability::Continuous
            });
            let _ = instance.set_input_derivatives(&inputs, &vec![0.0; inputs.len()]);
        }
        instance
    }
}

/// Returns an instance at a point. Sets values before Initialization Mode and in it, as an importer may do. If `running`, also sets the
/// states in Continuous-Time Mode, or does a step in Co-Simulation.
pub(crate) fn model_at<'a>(
    model: &'a LoadedModel,
    point: &Point,
    running: bool,
    standard: Standard,
) -> Outcome<Instance<'a>> {
    let offer = model.table.co_simulation.as_ref().filter(|_| point.interface == Interface::CoSimulation);
    let event_mode = standard == Standard::Fmi3 && offer.is_some_and(|offer| offer.event_mode);
    let mut instance = Instance::new(model, point.interface, standard, event_mode)?;
    instance.set(&point.values, Variable::has_start)?;
    instance.initialize(point.time, None, None)?;
    // Variables whose `initial` is `approx` have been calculated now, so they are not set again.
    instance.set(&point.values, |variable| variable.causality == Causality::Input || variable.is_exact())?;
    if !running {
        return Ok(instance);
    }
    instance.initialized()?;
    instance.run()?;
    if point.interface == Interface::CoSimulation {
        // Before the first step, states may depend on inputs and parameters, so one step is done. A model that rejects it is
        // unchanged.
        let _ = instance.step(model.table.info.step_size);
    } else {
        let mut states = instance.states()?;
        for ((index, _), state) in model.table.states.iter().zip(&mut states) {
            if let Some(Value::Real(value)) = point.values[*index as usize] {
                *state = value;
            }
        }
        instance.set_states(&states)?;
    }
    Ok(instance)
}

/// Returns whether a value is finite. Values that are not Real count as finite.
pub(crate) fn is_finite(value: &Value) -> bool {
    !matches!(value, Value::Real(value) if !value.is_finite())
}

/// Changes an element of an array together with the others: `share`, which is the same for all elements, gives the factor of a Real, or
/// the number that is added to an integer.
fn moved_in_common(variable: &Variable, value: &Value, share: f64) -> Value {
    match value {
        Value::Real(value) => Value::Real(value * (1.0 + 0.5 * share)),
        Value::Integer(value) if variable.range().is_some() => {
            Value::Integer(value.saturating_add((3.0 * share).round() as i128))
        }
        _ => value.clone(),
    }
}

/// Draws a value from the range of the type. A number is near the start value: `part` scales the largest distance. An enumeration
/// or Boolean differs from the previous value if possible. Returns `None` for strings and binary values.
pub(crate) fn draw_value(
    random: &mut fastrand::Rng,
    variable: &Variable,
    start: &Value,
    before: Option<&Value>,
    part: f64,
) -> Option<Value> {
    Some(match (start, variable.range()) {
        (Value::Real(start), _) => {
            let nominal = variable.attributes.nominal.unwrap_or(1.0);
            let reach = if *start == 0.0 { nominal } else { 0.5 * start.abs() };
            let value = start + part * reach * (2.0 * random.f64() - 1.0);
            let value = value.clamp(variable.min().unwrap_or(f64::MIN), variable.max().unwrap_or(f64::MAX));
            Value::Real(rounded(variable.base, value))
        }
        (Value::Integer(start), Some((min, max))) => {
            let reach = (3.0 * part).ceil() as i128;
            let start = (*start).clamp(min, max);
            let (low, high) = (min.max(start.saturating_sub(reach)), max.min(start.saturating_add(reach)));
            Value::Integer(random.i128(low..=high))
        }
        (Value::Integer(_), None) => {
            let values = variable.items.iter().map(|item| Value::Integer(item.value.into()));
            let others: Vec<Value> = values.filter(|value| Some(value) != before).collect();
            return if others.is_empty() {
                before.cloned()
            } else {
                Some(others[random.usize(..others.len())].clone())
            };
        }
        (Value::Boolean(_), _) => match before {
            Some(Value::Boolean(before)) => Value::Boolean(!before),
            _ => Value::Boolean(random.bool()),
        },
        (Value::String(_) | Value::Binary(_), _) => return None,
    })
}
