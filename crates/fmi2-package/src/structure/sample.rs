//! Points at which a model is asked.

use crate::check::has_start;
use crate::variant::Start;
use anyhow::{Result, bail};
use fmi2_export::{Causality, Interface, Kind, Model, ModelError, RealType, Variability};
use std::marker::PhantomData;

/// Values of everything that an importer can set before the simulation, and how it uses the model.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Point {
    values: Vec<Option<Start>>,
    time: f64,
    interface: Interface,
}

impl Point {
    /// By how much a Real variable differs.
    pub fn difference(from: &Self, to: &Self, vr: u32) -> Option<f64> {
        match (from.values[vr as usize], to.values[vr as usize]) {
            (Some(Start::Real(from)), Some(Start::Real(to))) => Some(to - from),
            _ => None,
        }
    }
}

/// A model at a point. Samples with the same number have the same parameters of that variability.
pub(super) struct FactorSample<M> {
    pub fixed: usize,
    pub tunable: usize,
    pub model: M,
}

/// Draws points.
pub(super) struct Sampler<M> {
    random: fastrand::Rng,
    tunable_parameters: bool,
    model: PhantomData<M>,
}

impl<M: Model> Sampler<M> {
    pub fn new(tunable_parameters: bool) -> Self {
        // The seed is fixed: the same model always gets the same description.
        Self { random: fastrand::Rng::with_seed(2), tunable_parameters, model: PhantomData }
    }

    /// Models that differ in fixed parameters, in tunable ones, and in inputs, states and time.
    pub fn factor_samples(&mut self) -> Result<Vec<FactorSample<M>>> {
        let is_parameter = |vr: u32| M::INFO.variables[vr as usize].causality() == Causality::Parameter;
        let tunable_parameters = self.tunable_parameters;
        let is_tunable = |vr: u32| {
            is_parameter(vr)
                && (tunable_parameters
                    || M::INFO.variables[vr as usize].variability() == Variability::Tunable)
        };
        let mut samples = Vec::new();
        for fixed in 0..4 {
            let (point, _) = self.draw(None, |_| true)?;
            for tunable in 0..3 {
                let (point, _) = self.draw(Some(&point), is_tunable)?;
                for _ in 0..3 {
                    let (_, model) = self.draw(Some(&point), |vr| !is_parameter(vr))?;
                    samples.push(FactorSample { fixed, tunable, model });
                }
            }
        }
        Ok(samples)
    }

    /// Draws new values for some variables, the rest being as before, until the model accepts them.
    pub fn draw(&mut self, before: Option<&Point>, which: impl Fn(u32) -> bool) -> Result<(Point, M)> {
        let mut point = before.cloned().unwrap_or_else(|| Point {
            values: vec![None; M::INFO.variables.len()],
            time: self.random.f64(),
            interface: self.draw_interface(),
        });
        let mut refused = None;
        for _ in 0..100 {
            for (vr, variable) in (0..).zip(M::INFO.variables) {
                if has_start(variable) && which(vr) {
                    let value = &mut point.values[vr as usize];
                    *value = Some(draw_value(&mut self.random, &variable.kind(), *value));
                }
            }
            match model_at(&point) {
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
        match (M::INFO.co_simulation, M::INFO.model_exchange) {
            (None, _) => Interface::ModelExchange,
            (_, None) => Interface::CoSimulation,
            _ if self.random.bool() => Interface::ModelExchange,
            _ => Interface::CoSimulation,
        }
    }
}

/// A model in Initialization Mode. An importer may set values before it enters that mode and in it.
fn model_at<M: Model>(point: &Point) -> Result<M, ModelError> {
    let mut model = M::new(point.interface);
    set_all(&mut model, point)?;
    model.initialize(point.time)?;
    if point.interface == Interface::ModelExchange {
        model.set_time(point.time);
    }
    set_all(&mut model, point)?;
    Ok(model)
}

fn set_all<M: Model>(model: &mut M, point: &Point) -> Result<(), ModelError> {
    for (vr, value) in (0..).zip(&point.values) {
        match *value {
            Some(Start::Real(value)) => model.set_real(vr, value),
            Some(Start::Integer(value)) => model.set_integer(vr, value),
            Some(Start::Boolean(value)) => model.set_boolean(vr, value),
            None => {}
        }
    }
    model.parameters_changed()
}

/// A value in the range of the variable, near its start value; another one than before where possible.
fn draw_value(random: &mut fastrand::Rng, kind: &Kind, before: Option<Start>) -> Start {
    match *kind {
        Kind::Real { of: RealType { min, max, nominal, .. }, start } => {
            let reach = if start == 0.0 { nominal.unwrap_or(1.0) } else { 0.5 * start.abs() };
            let value = start + reach * (2.0 * random.f64() - 1.0);
            Start::Real(value.clamp(min.unwrap_or(f64::MIN), max.unwrap_or(f64::MAX)))
        }
        Kind::Integer { min, max, start } => {
            let (low, high) = (min.max(start.saturating_sub(3)), max.min(start.saturating_add(3)));
            Start::Integer(random.i32(low..=high))
        }
        _ => match before {
            Some(Start::Boolean(before)) => Start::Boolean(!before),
            _ => Start::Boolean(random.bool()),
        },
    }
}
