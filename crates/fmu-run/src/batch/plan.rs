//! Checks a batch and looks up its variables.

use super::event_plan::EventPlan;
use super::exact::Input;
use super::inputs::{Inputs, checked, each_input, is_held};
use super::model_exchange_plan::ModelExchangePlan;
use super::{Batch, Column, Measure, Trajectory};
use crate::continuous::Integration;
use crate::error::{Error, request};
use crate::instance::{Tolerance, check_equal_step};
use crate::lookup::is_exact;
use crate::selection::{Assigned, Selection, Target};
use crate::start::{Start, StartValues};
use crate::system::System;
use fmi_abi::{BaseType, Interface, Standard, shown_number};

/// A checked batch.
pub(super) struct Plan<'a> {
    pub time: &'a [f64],
    pub runs: usize,
    pub inputs: Inputs<'a>,
    pub derivatives: Inputs<'a>,
    pub start: StartValues<'a>,
    /// Inputs whose values `f64` cannot represent.
    pub exact_inputs: Vec<Input>,
    pub outputs: Selection,
    /// Outputs whose values `f64` cannot represent.
    pub exact_outputs: Vec<Target>,
    /// Where the values of each output are.
    pub columns: Vec<Column>,
    pub every: Option<usize>,
    pub measures: &'a [Measure],
    pub threads: usize,
    pub read_before_set: bool,
    pub reuse: bool,
    pub tolerance: Tolerance,
    pub interface: Interface,
    /// Size of each step in Co-Simulation, s, if an FMU needs steps of equal size.
    pub step: Option<f64>,
    /// Clocks, and settings of events in Co-Simulation; `None` if there are none.
    pub events: Option<Box<EventPlan<'a>>>,
    /// Inputs and settings of Model Exchange; `None` in Co-Simulation.
    pub model_exchange: Option<ModelExchangePlan<'a>>,
}

impl<'a> Plan<'a> {
    pub fn of(system: &System, batch: &'a Batch, start: &[(&str, Start<'a>)]) -> Result<Self, Error> {
        let interface = system.interface(batch.interface)?;
        batch.tolerance.check()?;
        let time = checked_time(batch.time)?;
        let runs = runs(batch)?;
        let mut plan = Self {
            time,
            runs,
            inputs: Inputs::default(),
            derivatives: Inputs::default(),
            start: StartValues::of(system, start)?,
            exact_inputs: Vec::new(),
            outputs: Selection::default(),
            exact_outputs: Vec::new(),
            columns: Vec::new(),
            every: batch.every,
            measures: &batch.measures,
            threads: system.threads(interface, batch.threads, runs)?,
            read_before_set: batch.read_before_set,
            reuse: batch.reuse,
            tolerance: batch.tolerance,
            interface,
            step: None,
            events: EventPlan::of(system, batch, interface)?.map(Box::new),
            model_exchange: None,
        };
        if batch.every == Some(0) {
            return request("every must be at least 1".to_owned());
        }
        for name in &batch.outputs {
            if let (Some(events), Some(found)) = (&mut plan.events, system.find_clocked(name)) {
                let row = plan.outputs.len();
                events.add_output(name, found, row, batch)?;
                plan.columns.push(Column::Number(row));
                // `Ticking::show` writes this output into the row, so no variable is read here.
                plan.outputs.push(name, &[]);
                continue;
            }
            let found = system.find(name)?;
            let base = found[0].variable.base;
            if is_exact(base) {
                plan.columns.push(Column::Exact(plan.exact_outputs.len(), base));
                plan.exact_outputs.push(Target::of(found[0]));
            } else {
                plan.columns.push(Column::Number(plan.outputs.len()));
                plan.outputs.push(name, &found);
            }
        }
        match interface {
            Interface::CoSimulation => {
                check_of_co_simulation(batch, plan.events.is_some())?;
                if let Some(model) = system.fixed_step() {
                    check_equal_steps(model, time)?;
                    plan.step = Some((time[time.len() - 1] - time[0]) / (time.len() - 1) as f64);
                }
                plan.find_inputs(system, batch)?;
            }
            Interface::ModelExchange => {
                plan.model_exchange = ModelExchangePlan::of(system, batch, &mut plan.exact_inputs)?;
            }
        }
        Ok(plan)
    }

    /// Returns the number of times at which outputs are stored.
    pub fn stored_times(&self) -> usize {
        self.every.map_or(0, |every| self.time.len().div_ceil(every))
    }

    fn find_inputs(&mut self, system: &System, batch: &'a Batch) -> Result<(), Error> {
        let (inputs, mut events) = (&mut self.inputs, self.events.as_mut());
        each_input(system, batch, &mut self.exact_inputs, |name, trajectory, variables| {
            let of = variables[0].variable;
            let base = (of.base, variables[0].description.standard);
            let inputs = match &mut events {
                Some(events) if is_held(of) => &mut events.held,
                _ => &mut *inputs,
            };
            inputs.values.push(checked(name, base, trajectory, is_held(of), batch.time)?);
            inputs.variables.push(name, &variables);
            Ok(())
        })?;
        let (mut known, rate) = (Assigned::default(), (BaseType::Real, Standard::Fmi2));
        for (name, trajectory) in &batch.input_derivatives {
            let variables = system.takes_input_derivative(name)?;
            known.add(name, &variables);
            self.derivatives.values.push(checked(name, rate, *trajectory, true, batch.time)?);
            self.derivatives.variables.push(name, &variables);
        }
        known.check("input derivatives")
    }
}

/// Fails if settings for Model Exchange are given in Co-Simulation.
fn check_of_co_simulation(batch: &Batch, handles_events: bool) -> Result<(), Error> {
    if batch.integration != Integration::default() {
        return request(
            "solver, rtol, atol and max_step are for Model Exchange; in Co-Simulation the FMU has its own solver, see tolerance".to_owned(),
        );
    }
    if batch.events && !handles_events {
        return request(
            "events are for Model Exchange, and in Co-Simulation for a single FMU that has event mode (hasEventMode of FMI 3.0)".to_owned(),
        );
    }
    Ok(())
}

/// Fails if steps between these times have different sizes.
fn check_equal_steps(model: &str, time: &[f64]) -> Result<(), Error> {
    let first = time[1] - time[0];
    time.windows(2).try_for_each(|pair| check_equal_step(model, first, pair[1] - pair[0], pair[0]))
}

/// Fails unless there are at least two times, which are finite and increase.
fn checked_time(time: &[f64]) -> Result<&[f64], Error> {
    if time.len() < 2 {
        return request(format!("time has {} values; a run needs at least two", time.len()));
    }
    if let Some(index) = time.iter().position(|time| !time.is_finite()) {
        return request(format!("time[{index}] is {}; times must be finite", time[index]));
    }
    if let Some(index) = time.windows(2).position(|pair| pair[1] <= pair[0]) {
        let [before, after] = [time[index], time[index + 1]].map(shown_number);
        return request(format!(
            "time[{}] is {after}, which is not after time[{index}], {before}",
            index + 1
        ));
    }
    Ok(time)
}

/// Returns the number of runs. Fails if arguments have values for different numbers of runs, or a number of values that is not a
/// multiple of the number of times.
fn runs(batch: &Batch) -> Result<usize, Error> {
    let mut found: Option<(&str, usize)> = None;
    let trajectories =
        batch.inputs.iter().chain(&batch.input_derivatives).filter_map(|(name, trajectory)| {
            let (length, times) = trajectory.counts(batch.time.len())?;
            let is_each = matches!(trajectory, Trajectory::EachRun(_)) || length > times;
            (is_each && !matches!(trajectory, Trajectory::Shared(_))).then_some((*name, length, times))
        });
    let starts = batch.start.iter().filter_map(|(name, start)| Some((*name, start.count()?, 1)));
    for (name, length, times) in trajectories.chain(starts) {
        if length == 0 {
            return request(format!("{name} has no values; give one for each run"));
        }
        if times == 0 || length % times != 0 {
            return request(format!(
                "{name} has {length} values, which is not a multiple of the {times} times"
            ));
        }
        let runs = length / times;
        match found {
            Some((other, count)) if count != runs => {
                return request(format!("{other} is given for {count} runs, {name} for {runs}"));
            }
            _ => found = Some((name, runs)),
        }
    }
    Ok(found.map_or(1, |(_, runs)| runs))
}
