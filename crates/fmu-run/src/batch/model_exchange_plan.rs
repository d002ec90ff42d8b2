//! Checks the inputs and settings of runs in Model Exchange.

use super::exact::Input;
use super::inputs::{checked, each_input, is_held};
use super::series::Series;
use super::{Batch, Trajectory};
use crate::continuous::{Curve, Integration, Signals, Slopes};
use crate::description::Description;
use crate::error::{Error, request};
use crate::selection::Selection;
use crate::system::System;
use fmi_abi::{BaseType, Causality, Interface, Standard};
use std::sync::Arc;

/// Checked inputs and settings of runs in Model Exchange.
pub(super) struct ModelExchangePlan<'a> {
    pub description: Arc<Description>,
    /// Continuous inputs.
    pub moving: Selection,
    /// All other numeric inputs.
    pub held: Selection,
    /// Values of the continuous inputs, then of the others.
    sources: Vec<Source<'a>>,
    pub integration: Integration,
    pub rtol: f64,
    /// Whether the FMU must be notified of completed integrator steps.
    pub reports_steps: bool,
    pub keeps_events: bool,
}

/// Values of an input.
enum Source<'a> {
    /// Values, and their time derivatives if there are any.
    Numbers { values: Series<'a, f64>, slopes: Option<Series<'a, f64>> },
    /// The time derivative of the input with this index.
    RateOf(usize),
}

/// Relative tolerance of the solver if neither the caller nor the model description specifies one.
const RTOL: f64 = 1e-6;

impl<'a> ModelExchangePlan<'a> {
    /// Checks the inputs and settings. Adds the inputs whose values `f64` cannot represent to `exact`. Fails for a system of
    /// connected FMUs, which can run only in Co-Simulation.
    pub fn of(system: &System, batch: &'a Batch, exact: &mut Vec<Input>) -> Result<Option<Self>, Error> {
        batch.integration.check()?;
        if batch.read_before_set {
            return request("read_before_set is for Co-Simulation".to_owned());
        }
        let Some(fmu) = system.sole() else {
            return system.check_interface(Interface::ModelExchange).map(|()| None);
        };
        let description = Arc::clone(&fmu.description);
        let rtol = batch.integration.rtol.or(batch.tolerance.of(&description)).unwrap_or(RTOL);
        let offer = description.offer(Interface::ModelExchange);
        let reports_steps = offer.is_some_and(|offer| match description.standard {
            Standard::Fmi2 => !offer.can(&["completedIntegratorStepNotNeeded"]),
            Standard::Fmi3 => offer.can(&["needsCompletedIntegratorStep"]),
        });
        let mut model_exchange = Self {
            description,
            moving: Selection::default(),
            held: Selection::default(),
            sources: Vec::new(),
            integration: batch.integration,
            rtol: rtol.clamp(1e-13, 0.1),
            reports_steps,
            keeps_events: batch.events,
        };
        model_exchange.find_inputs(system, batch, exact)?;
        Ok(Some(model_exchange))
    }

    fn find_inputs(
        &mut self,
        system: &System,
        batch: &'a Batch,
        exact: &mut Vec<Input>,
    ) -> Result<(), Error> {
        let (mut held, mut rates) = (Vec::new(), Vec::new());
        each_input(system, batch, exact, |name, trajectory, variables| {
            let of = variables[0].variable;
            let base = (of.base, variables[0].description.standard);
            if is_held(of) {
                let values = checked(name, base, trajectory, true, batch.time)?;
                held.push(Source::Numbers { values, slopes: None });
                self.held.push(name, &variables);
            } else if let Trajectory::RateOf(other) = trajectory {
                rates.push((name, other, variables));
            } else {
                let values = checked(name, base, trajectory, false, batch.time)?;
                let slopes = slopes(name, &trajectory, batch)?;
                self.sources.push(Source::Numbers { values, slopes });
                self.moving.push(name, &variables);
            }
            Ok(())
        })?;
        // An input that is declared as the derivative of another input gets the slope of that input, unless the caller has given
        // values for it.
        let declared = self.description.variables.iter().filter(|of| {
            of.causality == Causality::Input
                && !is_held(of)
                && !batch.inputs.iter().any(|(name, _)| *name == of.name)
                && !batch.start.iter().any(|(name, _)| *name == of.name)
        });
        let declared: Vec<_> = declared.filter_map(|of| Some((of.name.clone(), of.derivative_of?))).collect();
        let known = |other: &str, moving: &Selection| moving.names().iter().position(|name| name == other);
        for (name, other, variables) in rates {
            let Some(index) = known(other, &self.moving) else {
                return request(format!(
                    "{name} is the derivative of {other}, which is not among the continuous inputs that have values"
                ));
            };
            self.sources.push(Source::RateOf(index));
            self.moving.push(name, &variables);
        }
        for (name, other) in declared {
            if let Some(index) = known(&self.description.variables[other].name, &self.moving) {
                self.sources.push(Source::RateOf(index));
                self.moving.push(&name, &system.find(&name)?);
            }
        }
        self.sources.extend(held);
        for (name, _) in &batch.input_derivatives {
            if known(name, &self.moving).is_none() {
                return request(format!("{name} has a derivative, but no values of a continuous input"));
            }
        }
        Ok(())
    }
}

/// Returns the time derivatives of an input, if given. They must be constant, or given at the same times as the values of the
/// input.
fn slopes<'a>(name: &str, values: &Trajectory, batch: &'a Batch) -> Result<Option<Series<'a, f64>>, Error> {
    let mut given = batch.input_derivatives.iter().filter(|(of, _)| *of == name);
    let Some((_, slopes)) = given.next() else { return Ok(None) };
    if given.next().is_some() {
        return request(format!("{name} is twice among the input derivatives"));
    }
    let times = |of: &Trajectory| match of {
        Trajectory::Sampled { times, .. } => Some(times.to_vec()),
        _ => None,
    };
    if !matches!(slopes, Trajectory::Constant(_)) && times(values) != times(slopes) {
        return request(format!("the derivatives of {name} must have the same times as its values"));
    }
    checked(name, (BaseType::Real, Standard::Fmi2), *slopes, false, batch.time).map(Some)
}

impl<'a> ModelExchangePlan<'a> {
    /// Returns the inputs of a run as functions of time.
    pub fn signals(&'a self, run: usize, points: &'a [f64]) -> Signals<'a> {
        let curve = |source: &'a Source<'a>| match source {
            Source::RateOf(index) => Curve::RateOf(*index),
            Source::Numbers { values: series, slopes } => {
                let (times, values) = (series.times(points), series.of_run(run));
                if let ([value], None) = (values, slopes) {
                    return Curve::Constant(*value);
                }
                let slopes = match slopes.as_ref().map(|slopes| slopes.of_run(run)) {
                    None => Slopes::Lines,
                    Some([slope]) => Slopes::Constant(*slope),
                    Some(slopes) => Slopes::Each(slopes),
                };
                Curve::Samples { times, values, slopes, is_held: series.is_held }
            }
        };
        Signals::new(self.sources.iter().map(curve), self.moving.len())
    }
}
