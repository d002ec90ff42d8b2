//! Checks a batch and looks up its names.

use super::{Batch, Measure, Trajectory};
use crate::error::{Error, request};
use crate::found::article;
use crate::instance::Tolerance;
use crate::selection::{Selection, Target, fits};
use crate::start::StartValues;
use crate::system::System;
use fmi_abi::{BaseType, Interface};
use std::sync::Arc;

/// A checked batch.
pub(super) struct Plan<'a> {
    pub time: &'a [f64],
    pub runs: usize,
    pub inputs: Inputs<'a>,
    pub derivatives: Inputs<'a>,
    /// Variables of both.
    pub set_in_steps: Arc<[Target]>,
    pub start: StartValues<'a>,
    pub outputs: Selection,
    pub every: Option<usize>,
    pub measures: &'a [Measure],
    pub threads: usize,
    pub read_before_set: bool,
    pub tolerance: Tolerance,
}

/// Inputs and their values.
#[derive(Default)]
pub(super) struct Inputs<'a> {
    pub variables: Selection,
    pub values: Vec<Trajectory<'a>>,
}

impl<'a> Plan<'a> {
    pub fn of(system: &System, batch: &'a Batch) -> Result<Self, Error> {
        system.check_interface(Interface::CoSimulation)?;
        batch.tolerance.check()?;
        let time = checked_time(batch.time)?;
        let runs = runs(batch)?;
        let mut plan = Self {
            time,
            runs,
            inputs: Inputs::default(),
            derivatives: Inputs::default(),
            set_in_steps: Arc::default(),
            start: StartValues::of(system, &batch.start)?,
            outputs: system.select(&batch.outputs)?,
            every: batch.every,
            measures: &batch.measures,
            threads: system.threads(Interface::CoSimulation, batch.threads, runs)?,
            read_before_set: batch.read_before_set,
            tolerance: batch.tolerance,
        };
        if batch.every == Some(0) {
            return request("every must be at least 1".to_owned());
        }
        plan.find_inputs(system, batch)?;
        Ok(plan)
    }

    /// Returns the number of kept times.
    pub fn kept(&self) -> usize {
        self.every.map_or(0, |every| self.time.len().div_ceil(every))
    }

    fn find_inputs(&mut self, system: &System, batch: &'a Batch) -> Result<(), Error> {
        let mut names = Vec::new();
        for (name, trajectory) in &batch.inputs {
            let variables = system.find_numbers(name)?;
            variables.iter().try_for_each(|found| found.check_own(name))?;
            let of = variables[0].variable;
            if !of.is_settable() || of.variability.as_deref() == Some("fixed") {
                return request(format!(
                    "{name} is no input but {} {}; give it a start value",
                    article(of.variability.as_deref().unwrap_or(&of.causality)),
                    of.causality
                ));
            }
            once(&mut names, name, "inputs")?;
            self.inputs.values.push(self.checked(name, of.base, *trajectory)?);
            self.inputs.variables.push(name, &variables);
        }
        let mut names = Vec::new();
        for (name, trajectory) in &batch.input_derivatives {
            let variables = system.takes_input_derivative(name)?;
            once(&mut names, name, "input derivatives")?;
            self.derivatives.values.push(self.checked(name, BaseType::Real, *trajectory)?);
            self.derivatives.variables.push(name, &variables);
        }
        let derivatives = self.derivatives.variables.targets();
        self.set_in_steps = self.inputs.variables.targets().chain(derivatives).collect();
        Ok(())
    }

    /// Checks the values of an input.
    fn checked(
        &self,
        name: &str,
        base: BaseType,
        trajectory: Trajectory<'a>,
    ) -> Result<Trajectory<'a>, Error> {
        let times = self.time.len();
        let values = match &trajectory {
            Trajectory::Constant(value) => std::slice::from_ref(value),
            Trajectory::Shared(values) if values.len() != times => {
                return request(format!("{name} has {} values for {times} times", values.len()));
            }
            Trajectory::Shared(values) | Trajectory::EachRun(values) => values,
        };
        fits(name, base, values)?;
        Ok(trajectory)
    }
}

fn checked_time(time: &[f64]) -> Result<&[f64], Error> {
    if time.len() < 2 {
        return request(format!("time has {} values; a run needs at least two", time.len()));
    }
    if let Some(index) = time.iter().position(|time| !time.is_finite()) {
        return request(format!("time[{index}] is {}; times must be finite", time[index]));
    }
    if let Some(index) = time.windows(2).position(|pair| pair[1] <= pair[0]) {
        let [before, after] = [time[index], time[index + 1]];
        return request(format!(
            "time[{}] is {after}, which is not after time[{index}], {before}",
            index + 1
        ));
    }
    Ok(time)
}

/// Returns the number of runs; checks that all values for each run agree on it.
fn runs(batch: &Batch) -> Result<usize, Error> {
    let mut found: Option<(&str, usize)> = None;
    let trajectories = batch.inputs.iter().chain(&batch.input_derivatives).filter_map(
        |(name, trajectory)| match trajectory {
            Trajectory::EachRun(values) => Some((*name, values.len(), batch.time.len())),
            _ => None,
        },
    );
    let starts = batch.start.iter().filter_map(|(name, start)| Some((*name, start.count()?, 1)));
    for (name, length, times) in trajectories.chain(starts) {
        if length % times != 0 {
            return request(format!("{name} has {length} values, which is no multiple of the {times} times"));
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

fn once<'a>(names: &mut Vec<&'a str>, name: &'a str, list: &str) -> Result<(), Error> {
    if names.contains(&name) {
        return request(format!("{name} is twice among the {list}"));
    }
    names.push(name);
    Ok(())
}
