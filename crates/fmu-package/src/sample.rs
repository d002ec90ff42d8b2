//! Points at which a model is asked.

use crate::check::{Starts, rounded};
use crate::instance::{Instance, Outcome};
use crate::model::LoadedModel;
use crate::table::{Attributes, Type, Variable};
use anyhow::{Result, anyhow};
use fmi_abi::{Causality, Interface, Standard, Value, Variability};
use std::collections::BTreeMap;

/// Values of everything that an importer can set before the simulation, and how it uses the model.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Point {
    /// By place; `None` for what stays as it is.
    pub values: Vec<Option<Value>>,
    pub time: f64,
    pub interface: Interface,
}

/// A model at a point. Samples with the same number have the same parameters of that variability.
pub(crate) struct FactorSample<'a> {
    pub fixed: usize,
    pub tunable: usize,
    pub model: Instance<'a>,
}

/// The point that a draw begins at, whether it has a new time, and the variables that it moves.
struct Draw<'d> {
    before: Option<&'d Point>,
    time: bool,
    which: &'d dyn Fn(&Variable) -> bool,
}

/// Draws points.
pub(crate) struct Sampler<'a> {
    /// Whether the models are at a communication point or in Continuous-Time Mode, not in Initialization Mode.
    pub running: bool,
    pub of: &'a LoadedModel,
    random: fastrand::Rng,
    starts: Starts,
    tunable_parameters: bool,
    /// The messages on the variables that could not be moved from a point, by place.
    pub stuck: BTreeMap<u32, String>,
}

/// Attempts with the same reach.
const ATTEMPTS: usize = 10;
/// The number of reaches.
const REACHES: usize = 10;

/// How far variables are moved, as parts of the usual distance.
#[derive(Clone, Copy)]
struct Reach {
    /// The first reach moves each element around its start value. All others move it around its value at the point before.
    first: bool,
    /// The part by which each element is moved separately.
    single: f64,
    /// The part by which all elements of an array are moved in proportion, which keeps their order.
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
    /// Around these start values.
    pub fn new(of: &'a LoadedModel, starts: Starts, tunable_parameters: bool) -> Self {
        // The seed is fixed: the same model always gets the same description.
        let random = fastrand::Rng::with_seed(2);
        Self { running: false, of, random, starts, tunable_parameters, stuck: BTreeMap::new() }
    }

    /// Models that differ in fixed parameters, in tunable ones, and in inputs, states and time.
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
                    let (point, model) = self.draw(Some(&point), true, |variable| !is_parameter(variable))?;
                    samples.push(FactorSample { fixed, tunable, model: self.go_on(model, &point, steps) });
                }
            }
        }
        Ok(samples)
    }

    /// Draws new values for some variables, and a new time or not, the rest being as before, until the model accepts
    /// them. A variable that the model accepts no new value of stays where it is, and is [`stuck`](Self::stuck).
    pub fn draw(
        &mut self,
        before: Option<&Point>,
        time: bool,
        which: impl Fn(&Variable) -> bool,
    ) -> Result<(Point, Instance<'a>)> {
        let mut point = before.cloned().unwrap_or_else(|| Point {
            values: vec![None; self.of.table.variables.len()],
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
                if let Ok(model) = self.accepted(&point, &draw) {
                    return Ok((point, model));
                }
            }
        }
        self.draw_one_by_one(point, &draw)
    }

    /// Moves one variable or array after the other, each as far as the model accepts it, the others being as before.
    fn draw_one_by_one(&mut self, at: Point, draw: &Draw) -> Result<(Point, Instance<'a>)> {
        let table = &self.of.table;
        let values = match draw.before {
            Some(before) => before.values.clone(),
            // Strings and bytes are not moved.
            None => {
                let is_moved = |value: &&Value| !matches!(value, Value::String(_) | Value::Binary(_));
                let starts = table.variables.iter().zip(&self.starts);
                starts
                    .map(|(of, start)| start.as_ref().filter(is_moved).filter(|_| of.is_moved()).cloned())
                    .collect()
            }
        };
        let mut point = Point { values, ..at };
        let mut model = self.accepted(&point, draw).map_err(|message| {
            let Point { time, interface, .. } = point;
            anyhow!(
                "the model rejects its own start values in {interface} at t = {time:.3} s, where it is tried: {message}"
            )
        })?;
        for place in 0..table.variables.len() {
            let of = &table.variables[place];
            let array = table.array(place as u32);
            let whole = array.iter().all(|place| (draw.which)(&table.variables[*place as usize]));
            if !(draw.which)(of) || whole && of.element > 0 || !of.is_moved() {
                continue;
            }
            let first = if whole { array[0] as usize } else { place };
            let places = first..first + if whole { array.len() } else { 1 };
            let mut message = String::new();
            let reaches = (1..REACHES).map(Reach::of);
            // Elements that cannot change separately may still change together.
            let together = reaches.clone().map(|reach| Reach { single: 0.0, ..reach });
            for reach in reaches.chain(together.filter(|_| places.len() > 1)) {
                let mut moved = point.clone();
                let is_here =
                    |of: &Variable| places.clone().any(|place| table.variables[place].name == of.name);
                self.move_values(&mut moved, draw, reach, &is_here);
                match self.accepted(&moved, draw) {
                    Ok(accepted) => {
                        (point, model) = (moved, accepted);
                        message.clear();
                        break;
                    }
                    Err(rejected) => message = rejected,
                }
            }
            if !message.is_empty() {
                self.stuck.insert(place as u32, message);
            }
        }
        Ok((point, model))
    }

    /// Draws new values for some variables of a point.
    fn move_values(
        &mut self,
        point: &mut Point,
        draw: &Draw,
        reach: Reach,
        which: &dyn Fn(&Variable) -> bool,
    ) {
        let table = &self.of.table;
        let mut share = 0.0;
        for (place, of) in table.variables.iter().enumerate().filter(|(_, of)| which(of) && of.is_moved()) {
            // States of a running model have been set, however they start.
            let zero = (self.running && of.state).then_some(&Value::Real(0.0));
            let Some(start) = self.starts[place].as_ref().or(zero) else { continue };
            let before = draw.before.and_then(|before| before.values[place].as_ref());
            let around = before.filter(|_| !reach.first).unwrap_or(start);
            let is_array =
                || table.array(place as u32).iter().all(|place| which(&table.variables[*place as usize]));
            if of.element == 0 && reach.common > 0.0 {
                share = 2.0 * self.random.f64() - 1.0;
            }
            let around = match reach.common > 0.0 && of.length() > 1 && is_array() {
                true => &moved_in_common(&of.of, around, share * reach.common),
                false => around,
            };
            let value = &mut point.values[place];
            *value = draw_value(&mut self.random, &of.of, around, value.as_ref(), reach.single);
        }
    }

    /// The model at a point, if it accepts that.
    fn accepted(&self, point: &Point, draw: &Draw) -> Outcome<Instance<'a>> {
        // No function sets states in Co-Simulation: they must not follow there from what is changed.
        let is_held = self.running && !draw.time && point.interface == Interface::CoSimulation;
        match draw.before.filter(|_| is_held) {
            Some(before) => model_at(self.of, before, true, Standard::Fmi3).and_then(|mut model| {
                model.set(&point.values, |of| (draw.which)(of) && !of.state)?;
                Ok(model)
            }),
            None => model_at(self.of, point, self.running, Standard::Fmi3),
        }
    }

    /// The lists serve both interface types, so both are looked at.
    fn draw_interface(&mut self) -> Interface {
        let offered: Vec<Interface> = self.of.table.interfaces().collect();
        offered[self.random.usize(..offered.len())]
    }

    /// Takes steps in Co-Simulation, and gives derivatives of the inputs after the first one: factors may depend on both.
    fn go_on(&self, model: Instance<'a>, point: &Point, steps: usize) -> Instance<'a> {
        if point.interface != Interface::CoSimulation {
            return model;
        }
        let table = &self.of.table;
        let with_rates = table.input_derivatives && steps == 1;
        let mut model = match model_at(self.of, point, self.running, Standard::Fmi2) {
            Ok(with_rates_model) if with_rates => with_rates_model,
            _ => model,
        };
        for _ in 0..steps {
            // A model may reject the step: it is then as it was before.
            if model.step(table.info.step_size).is_err() {
                break;
            }
        }
        if with_rates {
            let inputs = table
                .find(|of| of.causality == Causality::Input && of.variability == Variability::Continuous);
            let _ = model.set_input_derivatives(&inputs, &vec![0.0; inputs.len()]);
        }
        model
    }
}

/// A model at a point. An importer may set values before it enters Initialization Mode and in it, and sets states later.
pub(crate) fn model_at<'a>(
    of: &'a LoadedModel,
    point: &Point,
    running: bool,
    standard: Standard,
) -> Outcome<Instance<'a>> {
    let offer = of.table.co_simulation.as_ref().filter(|_| point.interface == Interface::CoSimulation);
    let event_mode = standard == Standard::Fmi3 && offer.is_some_and(|offer| offer.event_mode);
    let mut model = Instance::new(of, point.interface, standard, event_mode)?;
    model.set(&point.values, Variable::has_start)?;
    model.initialize(point.time, None, None)?;
    // What is approx has been calculated now.
    model.set(&point.values, |of| of.causality == Causality::Input || of.is_exact())?;
    if !running {
        return Ok(model);
    }
    model.initialized()?;
    model.run()?;
    if point.interface == Interface::CoSimulation {
        // Until then states may follow from inputs and parameters. A model may reject the step: it is then as it was before.
        let _ = model.step(of.table.info.step_size);
    } else {
        let mut states = model.states()?;
        for ((place, _), state) in of.table.states.iter().zip(&mut states) {
            if let Some(Value::Real(value)) = point.values[*place as usize] {
                *state = value;
            }
        }
        model.set_states(&states)?;
    }
    Ok(model)
}

/// The value of an array's element when all elements change by a common factor, or integers by a common number.
fn moved_in_common(of: &Type, value: &Value, share: f64) -> Value {
    match (&of.attributes, value) {
        (Attributes::Real { .. }, &Value::Real(value)) => Value::Real(value * (1.0 + 0.5 * share)),
        (Attributes::Integer { .. }, &Value::Integer(value)) => {
            Value::Integer(value.saturating_add((3.0 * share).round() as i128))
        }
        _ => value.clone(),
    }
}

/// A value in the range of the type, near the start value by a `part` of the usual distance; another one than before where
/// possible. `None` for strings and bytes, whose other possible values are unknown.
pub(crate) fn draw_value(
    random: &mut fastrand::Rng,
    of: &Type,
    start: &Value,
    before: Option<&Value>,
    part: f64,
) -> Option<Value> {
    Some(match (&of.attributes, start) {
        (Attributes::Real { min, max, nominal, .. }, &Value::Real(start)) => {
            let reach = if start == 0.0 { nominal.unwrap_or(1.0) } else { 0.5 * start.abs() };
            let value = start + part * reach * (2.0 * random.f64() - 1.0);
            let value = value.clamp(min.unwrap_or(f64::MIN), max.unwrap_or(f64::MAX));
            Value::Real(rounded(of.base, value))
        }
        (Attributes::Integer { min, max }, &Value::Integer(start)) => {
            let reach = (3.0 * part).ceil() as i128;
            let start = start.clamp(*min, *max);
            let (low, high) =
                (*min.max(&start.saturating_sub(reach)), *max.min(&start.saturating_add(reach)));
            Value::Integer(random.i128(low..=high))
        }
        (Attributes::Enumeration(items), _) => {
            let values = items.iter().map(|item| Value::Integer(item.value.into()));
            let others: Vec<Value> = values.filter(|value| Some(value) != before).collect();
            return if others.is_empty() {
                before.cloned()
            } else {
                Some(others[random.usize(..others.len())].clone())
            };
        }
        (Attributes::Other, Value::Boolean(_)) => match before {
            Some(Value::Boolean(before)) => Value::Boolean(!before),
            _ => Value::Boolean(random.bool()),
        },
        _ => return None,
    })
}
