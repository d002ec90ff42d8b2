//! Points at which a model is asked.

use crate::check::{Starts, rounded};
use crate::instance::{Instance, Outcome};
use crate::model::LoadedModel;
use crate::table::{Attributes, Type, Variable};
use anyhow::{Result, bail};
use fmi_abi::{Causality, Interface, Standard, Value, Variability};

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

/// Draws points.
pub(crate) struct Sampler<'a> {
    /// Whether the models are at a communication point or in Continuous-Time Mode, not in Initialization Mode.
    pub running: bool,
    pub of: &'a LoadedModel,
    random: fastrand::Rng,
    starts: Starts,
    tunable_parameters: bool,
}

impl<'a> Sampler<'a> {
    /// Around these start values.
    pub fn new(of: &'a LoadedModel, starts: Starts, tunable_parameters: bool) -> Self {
        // The seed is fixed: the same model always gets the same description.
        let random = fastrand::Rng::with_seed(2);
        Self { running: false, of, random, starts, tunable_parameters }
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
    /// them.
    pub fn draw(
        &mut self,
        before: Option<&Point>,
        time: bool,
        which: impl Fn(&Variable) -> bool,
    ) -> Result<(Point, Instance<'a>)> {
        let table = &self.of.table;
        let mut point = before.cloned().unwrap_or_else(|| Point {
            values: vec![None; table.variables.len()],
            time: 0.0,
            interface: self.draw_interface(),
        });
        if time {
            point.time = self.random.f64();
        }
        let mut rejected = None;
        for _ in 0..100 {
            for (place, variable) in
                table.variables.iter().enumerate().filter(|(_, variable)| which(variable))
            {
                // States of a running model have been set, however they start.
                let zero = (self.running && variable.state).then_some(&Value::Real(0.0));
                if let Some(start) = self.starts[place].as_ref().or(zero)
                    && variable.variability != Variability::Constant
                {
                    let value = &mut point.values[place];
                    *value = draw_value(&mut self.random, &variable.of, start, value.as_ref());
                }
            }
            // No function sets states in Co-Simulation: they must not follow there from what is changed.
            let is_held = self.running && !time && point.interface == Interface::CoSimulation;
            let model = match before.filter(|_| is_held) {
                Some(before) => model_at(self.of, before, true, Standard::Fmi3).and_then(|mut model| {
                    model.set(&point.values, |of| which(of) && !of.state)?;
                    Ok(model)
                }),
                None => model_at(self.of, &point, self.running, Standard::Fmi3),
            };
            match model {
                Ok(model) => return Ok((point, model)),
                Err(message) => rejected = Some(message),
            }
        }
        bail!("the model takes no values near its start values: {}", rejected.unwrap_or_default())
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

/// A value in the range of the type, near the start value; another one than before where possible. `None` for
/// texts and bytes, of which nobody knows what else they could be.
pub(crate) fn draw_value(
    random: &mut fastrand::Rng,
    of: &Type,
    start: &Value,
    before: Option<&Value>,
) -> Option<Value> {
    Some(match (&of.attributes, start) {
        (Attributes::Real { min, max, nominal, .. }, &Value::Real(start)) => {
            let reach = if start == 0.0 { nominal.unwrap_or(1.0) } else { 0.5 * start.abs() };
            let value = start + reach * (2.0 * random.f64() - 1.0);
            let value = value.clamp(min.unwrap_or(f64::MIN), max.unwrap_or(f64::MAX));
            Value::Real(rounded(of.base, value))
        }
        (Attributes::Integer { min, max }, &Value::Integer(start)) => {
            let (low, high) = (*min.max(&start.saturating_sub(3)), *max.min(&start.saturating_add(3)));
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
