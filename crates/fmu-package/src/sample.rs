//! Points at which a model is asked.

use crate::check::{Starts, interfaces, rounded};
use anyhow::{Result, bail};
use fmu_export::{
    Attributes, Causality, Error, Experiment, Exported, Initial, Interface, Setup, Step, Type, Value,
    Variability, Variable,
};
use std::marker::PhantomData;

/// Values of everything that an importer can set before the simulation, and how it uses the model.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Point {
    /// By value reference; `None` for what stays as it is.
    pub values: Vec<Option<Value>>,
    pub time: f64,
    pub interface: Interface,
}

/// A model at a point. Samples with the same number have the same parameters of that variability.
pub(crate) struct FactorSample<M> {
    pub fixed: usize,
    pub tunable: usize,
    pub model: M,
}

/// Draws points.
pub(crate) struct Sampler<M> {
    /// Whether the models are at a communication point or in Continuous-Time Mode, not in Initialization Mode.
    pub running: bool,
    random: fastrand::Rng,
    starts: Starts,
    tunable_parameters: bool,
    model: PhantomData<M>,
}

impl<M: Exported> Sampler<M> {
    /// Around these start values.
    pub fn new(starts: Starts, tunable_parameters: bool) -> Self {
        // The seed is fixed: the same model always gets the same description.
        let random = fastrand::Rng::with_seed(2);
        Self { running: false, random, starts, tunable_parameters, model: PhantomData }
    }

    /// Models that differ in fixed parameters, in tunable ones, and in inputs, states and time.
    pub fn factor_samples(&mut self) -> Result<Vec<FactorSample<M>>> {
        let is_parameter = |variable: &Variable<M>| variable.causality() == Causality::Parameter;
        let tunable_parameters = self.tunable_parameters;
        let is_tunable = |variable: &Variable<M>| {
            is_parameter(variable) && (tunable_parameters || variable.variability() == Variability::Tunable)
        };
        let mut samples = Vec::new();
        for fixed in 0..8 {
            let (point, _) = self.draw(None, true, |_| true)?;
            for tunable in 0..3 {
                let (point, _) = self.draw(Some(&point), false, is_tunable)?;
                for steps in 0..3 {
                    let (point, mut model) =
                        self.draw(Some(&point), true, |variable| !is_parameter(variable))?;
                    go_on(&mut model, &point, steps);
                    samples.push(FactorSample { fixed, tunable, model });
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
        which: impl Fn(&Variable<M>) -> bool,
    ) -> Result<(Point, M)> {
        let mut point = before.cloned().unwrap_or_else(|| Point {
            values: vec![None; M::TABLE.len()],
            time: 0.0,
            interface: self.draw_interface(),
        });
        if time {
            point.time = self.random.f64();
        }
        let mut refused = None;
        for _ in 0..100 {
            for (place, variable) in M::TABLE.iter().enumerate().filter(|(_, variable)| which(variable)) {
                // States of a running model have been set, however they start.
                let zero = (self.running && variable.is_state()).then_some(&Value::Real(0.0));
                if let Some(start) = self.starts[place].as_ref().or(zero)
                    && variable.variability() != Variability::Constant
                {
                    let value = &mut point.values[place];
                    *value = draw_value(&mut self.random, variable.variable_type(), start, value.as_ref());
                }
            }
            match model_at(&point, self.running) {
                Ok(model) => return Ok((point, model)),
                Err(error) => refused = Some(error),
            }
        }
        bail!(
            "the model takes no values near its start values: {}",
            refused.map_or_else(String::new, |e| e.to_string())
        )
    }

    /// The lists serve both interface types, so both are looked at.
    fn draw_interface(&mut self) -> Interface {
        let offered: Vec<Interface> = interfaces::<M>().collect();
        offered[self.random.usize(..offered.len())]
    }
}

/// A model at a point. An importer may set values before it enters Initialization Mode and in it, and sets states later.
pub(crate) fn model_at<M: Exported>(point: &Point, running: bool) -> Result<M, Error> {
    let mut model = M::new(&Setup::new(point.interface))?;
    set(&mut model, point, Variable::has_start)?;
    model.initialize(&Experiment { start_time: point.time, ..Experiment::default() })?;
    // What is approx has been calculated now.
    let is_set = |variable: &Variable<M>| {
        variable.initial() != Some(Initial::Approx) || running && variable.is_state()
    };
    set(&mut model, point, is_set)?;
    model.calculate(point.time);
    Ok(model)
}

/// Takes steps in Co-Simulation, and gives derivatives of the inputs after the first one: factors may depend on both.
fn go_on<M: Exported>(model: &mut M, point: &Point, steps: usize) {
    if point.interface != Interface::CoSimulation {
        return;
    }
    let size = M::INFO.default_experiment.step_size;
    for step in 0..steps {
        // A model may reject the step: it is then as it was before.
        let _ = model.exported_step(Step::new(point.time + step as f64 * size, size));
    }
    for (place, variable) in (0..).zip(M::TABLE).filter(|_| steps == 1 && M::INPUT_DERIVATIVES) {
        if variable.causality() == Causality::Input && variable.variability() == Variability::Continuous {
            model.exported_input_derivative(M::element(place), 1, 0.0);
        }
    }
    model.calculate(point.time + steps as f64 * size);
}

fn set<M: Exported>(model: &mut M, point: &Point, which: impl Fn(&Variable<M>) -> bool) -> Result<(), Error> {
    for (variable, value) in M::TABLE.iter().zip(&point.values) {
        if let Some(value) = value
            && which(variable)
        {
            variable.set(model, value);
            model.calculate_start();
        }
    }
    model.update()
}

/// A value in the range of the type, near the start value; another one than before where possible. `None` for
/// texts and bytes, of which nobody knows what else they could be.
pub(crate) fn draw_value(
    random: &mut fastrand::Rng,
    of: &Type,
    start: &Value,
    before: Option<&Value>,
) -> Option<Value> {
    Some(match (of.attributes, start) {
        (Attributes::Real { min, max, nominal, .. }, &Value::Real(start)) => {
            let reach = if start == 0.0 { nominal.unwrap_or(1.0) } else { 0.5 * start.abs() };
            let value = start + reach * (2.0 * random.f64() - 1.0);
            let value = value.clamp(min.unwrap_or(f64::MIN), max.unwrap_or(f64::MAX));
            Value::Real(rounded(of.base(), value))
        }
        (Attributes::Integer { min, max }, &Value::Integer(start)) => {
            let (low, high) = (min.max(start.saturating_sub(3)), max.min(start.saturating_add(3)));
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
        (Attributes::Boolean, _) => match before {
            Some(Value::Boolean(before)) => Value::Boolean(!before),
            _ => Value::Boolean(random.bool()),
        },
        _ => return None,
    })
}
