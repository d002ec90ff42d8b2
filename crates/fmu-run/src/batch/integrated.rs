//! Runs in Model Exchange.

use super::Occurrence;
use super::exact::Input;
use super::plan::{Numbers, Plan, input, is_held, once};
use super::run::{Kept, Stopped, Worker};
use super::{Batch, Trajectory};
use crate::continuous::{Curve, Hooks, Integration, March, Model, Signals, Slopes, Solver};
use crate::description::Description;
use crate::error::{Error, request};
use crate::running::Running;
use crate::selection::Selection;
use crate::start::is_exact;
use crate::system::System;
use fmi_abi::{BaseType, Interface, Standard};
use fmi_client::Rejection;
use std::sync::Arc;

/// Inputs and settings of runs in Model Exchange.
pub(super) struct Integrated<'a> {
    description: Arc<Description>,
    /// Continuous inputs, and all others that have numbers; `sources` contains both, in this order.
    moving: Selection,
    held: Selection,
    sources: Vec<Source<'a>>,
    integration: Integration,
    rtol: f64,
    reports_steps: bool,
    keeps_events: bool,
}

/// Values of an input.
enum Source<'a> {
    /// Values, with their derivatives if there are any, and whether they are held.
    Numbers { values: Numbers<'a>, slopes: Option<Numbers<'a>>, is_held: bool },
    /// The derivative of another input.
    RateOf(usize),
}

/// Relative tolerance if neither the caller nor the model description has one.
const RTOL: f64 = 1e-6;

impl<'a> Plan<'a> {
    /// Checks the inputs and settings of Model Exchange.
    pub fn integrate(&mut self, system: &System, batch: &'a Batch) -> Result<(), Error> {
        batch.integration.check()?;
        if batch.read_before_set {
            return request("read_before_set is for Co-Simulation".to_owned());
        }
        let Some(fmu) = system.sole() else { return system.check_interface(Interface::ModelExchange) };
        let description = Arc::clone(&fmu.description);
        let rtol = batch.integration.rtol.or(self.tolerance.of(&description)).unwrap_or(RTOL);
        let offer = description.offer(Interface::ModelExchange);
        let reports_steps = offer.is_some_and(|offer| match description.standard {
            Standard::Fmi2 => !offer.can(&["completedIntegratorStepNotNeeded"]),
            Standard::Fmi3 => offer.can(&["needsCompletedIntegratorStep"]),
        });
        let mut integrated = Integrated {
            description,
            moving: Selection::default(),
            held: Selection::default(),
            sources: Vec::new(),
            integration: batch.integration,
            rtol: rtol.clamp(1e-13, 0.1),
            reports_steps,
            keeps_events: batch.events,
        };
        self.find_continuous(system, batch, &mut integrated)?;
        self.integrated = Some(integrated);
        Ok(())
    }

    fn find_continuous(
        &mut self,
        system: &System,
        batch: &'a Batch,
        integrated: &mut Integrated<'a>,
    ) -> Result<(), Error> {
        let (mut names, mut held, mut rates) = (Vec::new(), Vec::new(), Vec::new());
        for (name, trajectory) in &batch.inputs {
            let variables = input(system, name)?;
            let of = variables[0].variable;
            once(&mut names, name, "inputs")?;
            if is_exact(of.base) {
                self.exact_inputs.push(Input::of(name, &variables, *trajectory, self.time)?);
            } else if is_held(of) {
                let values = self.checked(name, of.base, *trajectory, true)?;
                held.push(Source::Numbers { values, slopes: None, is_held: true });
                integrated.held.push(name, &variables);
            } else if let Trajectory::RateOf(other) = trajectory {
                rates.push((*name, *other, variables));
            } else {
                let values = self.checked(name, of.base, *trajectory, false)?;
                let slopes = self.slopes(name, trajectory, batch)?;
                integrated.sources.push(Source::Numbers { values, slopes, is_held: false });
                integrated.moving.push(name, &variables);
            }
        }
        // Inputs that the model description declares as derivatives of given ones, unless the caller has values for them.
        let declared = integrated.description.variables.iter().filter(|of| {
            of.causality == "input"
                && !is_held(of)
                && !names.contains(&of.name.as_str())
                && !batch.start.iter().any(|(name, _)| *name == of.name)
        });
        let declared: Vec<_> =
            declared.filter_map(|of| Some((of.name.clone(), of.derivative_of.clone()?))).collect();
        let known = |other: &str, moving: &Selection| moving.names().iter().position(|name| name == other);
        for (name, other, variables) in rates {
            let Some(index) = known(other, &integrated.moving) else {
                return request(format!(
                    "{name} is the derivative of {other}, which is not among the continuous inputs that have values"
                ));
            };
            integrated.sources.push(Source::RateOf(index));
            integrated.moving.push(name, &variables);
        }
        for (name, other) in declared {
            if let Some(index) = known(&other, &integrated.moving) {
                integrated.sources.push(Source::RateOf(index));
                integrated.moving.push(&name, &system.find(&name)?);
            }
        }
        integrated.sources.extend(held);
        for (name, _) in &batch.input_derivatives {
            if known(name, &integrated.moving).is_none() {
                return request(format!("{name} has a derivative, but no values of a continuous input"));
            }
        }
        Ok(())
    }

    /// Returns the derivatives of an input, which must be at the times of its values.
    fn slopes(
        &self,
        name: &str,
        values: &Trajectory,
        batch: &'a Batch,
    ) -> Result<Option<Numbers<'a>>, Error> {
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
        self.checked(name, BaseType::Real, *slopes, false).map(Some)
    }
}

/// Returns the values of a run.
fn of_run<'a>(numbers: &'a Numbers<'a>, run: usize, points: &'a [f64]) -> (&'a [f64], &'a [f64]) {
    let part =
        |values: &'a [f64], length, is_each| &values[if is_each { run * length } else { 0 }..][..length];
    match numbers {
        Numbers::Constant(value) => (&points[..1], std::slice::from_ref(value)),
        Numbers::Shared(values) => (points, values),
        Numbers::EachRun(values) => (points, part(values, points.len(), true)),
        Numbers::Sampled { times, values, is_each, .. } => (times, part(values, times.len(), *is_each)),
    }
}

impl<'a> Integrated<'a> {
    /// Returns the inputs of a run as functions of time.
    fn signals(&'a self, run: usize, points: &'a [f64]) -> Signals<'a> {
        let curve = |source: &'a Source<'a>| match source {
            Source::RateOf(index) => Curve::RateOf(*index),
            Source::Numbers { values, slopes, is_held } => {
                let (times, values) = of_run(values, run, points);
                if let ([value], None) = (values, slopes) {
                    return Curve::Constant(*value);
                }
                let slopes = match slopes {
                    None => Slopes::Lines,
                    Some(Numbers::Constant(slope)) => Slopes::Constant(*slope),
                    Some(slopes) => Slopes::Each(of_run(slopes, run, points).1),
                };
                Curve::Samples { times, values, slopes, is_held: *is_held }
            }
        };
        Signals::new(self.sources.iter().map(curve), self.moving.len())
    }
}

impl<'a> Worker<'a> {
    /// Runs an instance in Model Exchange, as `follow` does in Co-Simulation.
    pub fn integrate(
        &mut self,
        integrated: &'a Integrated<'a>,
        times: &[f64],
        instance: &mut Running,
        run: usize,
        trajectories: &mut [f64],
    ) -> Result<(), Stopped> {
        let plan = self.plan;
        let before = |rejection| (None, rejection);
        instance.begin(self.experiment(), &plan.start, run).map_err(before)?;
        for input in &plan.exact_inputs {
            input.set(instance, run, 0).map_err(before)?;
        }
        let Integrated { description, moving, held, integration, rtol, reports_steps, .. } = integrated;
        let inputs = integrated.signals(run, plan.time);
        let retries = integration.solver != Solver::Rk4;
        let model = Model::new(instance, description, inputs, [moving, held], retries);
        model.parts().begin(times[0]).map_err(before)?;
        model.parts().running.exit_initialization_mode().map_err(before)?;
        model.parts().running.forget_log();
        let sizes = [description.states, description.event_indicators];
        let mut march = March::new(times, sizes, integration, *rtol, *reports_steps);
        let mut kept = Kept::default();
        let mut observed = Observed { worker: self, times, trajectories, kept: &mut kept, run, before: None };
        let result = march.run(&model, &mut observed);
        result.map_err(|rejection| {
            if let Some(end) = rejection.ended() {
                self.end(model.parts().running, times, (march.next, end), &mut kept, trajectories);
            }
            (march.next.checked_sub(1), rejection)
        })
    }

    /// Reads the outputs at the end of a run that the FMU ends. At a communication point they belong to the results.
    fn end(
        &mut self,
        running: &mut Running,
        times: &[f64],
        (next, end): (usize, f64),
        kept: &mut Kept,
        trajectories: &mut [f64],
    ) {
        let is_point = times.get(next).is_some_and(|time| *time <= end);
        let read = match is_point {
            true => self.record(running, kept, end, trajectories),
            false => running.get(&self.plan.outputs, &mut self.row),
        };
        match read {
            Ok(()) if is_point => self.reached = next + 1,
            Ok(()) => {}
            Err(_) => self.row.fill(f64::NAN),
        }
    }
}

/// A run as the march sees it.
struct Observed<'w, 'a> {
    worker: &'w mut Worker<'a>,
    times: &'w [f64],
    trajectories: &'w mut [f64],
    kept: &'w mut Kept,
    run: usize,
    /// Outputs before an event.
    before: Option<Vec<f64>>,
}

impl Hooks for Observed<'_, '_> {
    fn record(&mut self, running: &mut Running, index: usize) -> Result<(), Rejection> {
        let Self { worker, times, trajectories, kept, run, .. } = self;
        worker.report_time(*run, times[index]);
        worker.record(running, kept, times[index], trajectories)?;
        worker.reached = index + 1;
        Ok(())
    }

    fn proceed(&mut self, time: f64) -> bool {
        self.worker.report_time(self.run, time);
        self.worker.proceeds()
    }

    fn event(&mut self, running: &mut Running, time: f64, is_after: bool) -> Result<(), Rejection> {
        let plan = self.worker.plan;
        if plan.integrated.as_ref().is_none_or(|of| !of.keeps_events) || self.worker.is_repeated() {
            return Ok(());
        }
        let mut row = vec![0.0; plan.outputs.len()];
        running.get(&plan.outputs, &mut row)?;
        if !is_after {
            self.before = Some(row);
        } else if let Some(before) = self.before.take() {
            self.worker.events.push(Occurrence { run: self.run, time, before, after: row });
        }
        Ok(())
    }

    fn changes(&self, index: usize) -> bool {
        self.worker.plan.exact_inputs.iter().any(|input| input.changes(self.run, index))
    }

    fn set_exact(&mut self, running: &mut Running, index: usize) -> Result<(), Rejection> {
        self.worker.plan.exact_inputs.iter().try_for_each(|input| input.set(running, self.run, index))
    }
}
