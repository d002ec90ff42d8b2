//! Checks a batch and looks up its names.

use super::exact::Input;
use super::grid::Grid;
use super::integrated::Integrated;
use super::{Batch, Measure, Trajectory};
use crate::continuous::Integration;
use crate::description::Variable;
use crate::error::{Error, request};
use crate::found::{Found, article};
use crate::instance::Tolerance;
use crate::selection::{Selection, Target, fits};
use crate::start::{Start, StartValues, is_exact};
use crate::system::System;
use fmi_abi::{BaseType, Interface};
use std::hash::{DefaultHasher, Hasher};
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
    /// Inputs whose values numbers do not have.
    pub exact_inputs: Vec<Input>,
    pub outputs: Selection,
    /// Outputs whose values numbers do not have.
    pub exact_outputs: Vec<(String, Target)>,
    pub every: Option<usize>,
    pub measures: &'a [Measure],
    pub threads: usize,
    pub read_before_set: bool,
    pub tolerance: Tolerance,
    pub interface: Interface,
    /// Inputs and settings of Model Exchange.
    pub integrated: Option<Integrated<'a>>,
}

/// Inputs and their values.
#[derive(Default)]
pub(super) struct Inputs<'a> {
    pub variables: Selection,
    pub values: Vec<Numbers<'a>>,
}

/// Numbers of an input.
pub(super) enum Numbers<'a> {
    Constant(f64),
    Shared(&'a [f64]),
    EachRun(&'a [f64]),
    /// At times of the input; whether they are held, and whether each run has its own.
    Sampled {
        grid: Grid,
        times: &'a [f64],
        values: &'a [f64],
        is_held: bool,
        is_each: bool,
    },
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
            set_in_steps: Arc::default(),
            start: StartValues::of(system, start)?,
            exact_inputs: Vec::new(),
            outputs: Selection::default(),
            exact_outputs: Vec::new(),
            every: batch.every,
            measures: &batch.measures,
            threads: system.threads(interface, batch.threads, runs)?,
            read_before_set: batch.read_before_set,
            tolerance: batch.tolerance,
            interface,
            integrated: None,
        };
        if batch.every == Some(0) {
            return request("every must be at least 1".to_owned());
        }
        for name in &batch.outputs {
            let found = system.find(name)?;
            if is_exact(found[0].variable.base) {
                plan.exact_outputs.push(((*name).to_owned(), Target::of(found[0])));
            } else {
                plan.outputs.push(name, &found);
            }
        }
        match interface {
            Interface::CoSimulation => {
                check_of_co_simulation(batch)?;
                plan.find_inputs(system, batch)?;
            }
            Interface::ModelExchange => plan.integrate(system, batch)?,
        }
        Ok(plan)
    }

    /// Returns the number of kept times.
    pub fn kept(&self) -> usize {
        self.every.map_or(0, |every| self.time.len().div_ceil(every))
    }

    fn find_inputs(&mut self, system: &System, batch: &'a Batch) -> Result<(), Error> {
        let mut names = Vec::new();
        for (name, trajectory) in &batch.inputs {
            let variables = input(system, name)?;
            let of = variables[0].variable;
            once(&mut names, name, "inputs")?;
            if is_exact(of.base) {
                self.exact_inputs.push(Input::of(name, &variables, *trajectory, self.time)?);
                continue;
            }
            self.inputs.values.push(self.checked(name, of.base, *trajectory, is_held(of))?);
            self.inputs.variables.push(name, &variables);
        }
        let mut names = Vec::new();
        for (name, trajectory) in &batch.input_derivatives {
            let variables = system.takes_input_derivative(name)?;
            once(&mut names, name, "input derivatives")?;
            self.derivatives.values.push(self.checked(name, BaseType::Real, *trajectory, true)?);
            self.derivatives.variables.push(name, &variables);
        }
        let derivatives = self.derivatives.variables.targets();
        let exact = self.exact_inputs.iter().flat_map(|input| input.targets()).copied();
        self.set_in_steps = self.inputs.variables.targets().chain(derivatives).chain(exact).collect();
        Ok(())
    }

    /// Returns a hash of the values of all inputs in a run.
    pub fn hash_of_inputs(&self, run: usize) -> u64 {
        let mut hash = DefaultHasher::new();
        let times = self.time.len();
        for numbers in self.inputs.values.iter().chain(&self.derivatives.values) {
            let of_run = |values: &'a [f64], length| &values[run * length..][..length];
            let values = match numbers {
                Numbers::Constant(value) => std::slice::from_ref(value),
                Numbers::Shared(values) => values,
                Numbers::EachRun(values) => of_run(values, times),
                Numbers::Sampled { values, is_each: false, .. } => values,
                Numbers::Sampled { grid, values, .. } => of_run(values, grid.length),
            };
            values.iter().for_each(|value| hash.write_u64(value.to_bits()));
        }
        for input in &self.exact_inputs {
            input.hash(run, times, &mut hash);
        }
        hash.finish()
    }

    /// Checks the values of an input.
    pub fn checked(
        &self,
        name: &str,
        base: BaseType,
        trajectory: Trajectory<'a>,
        is_held: bool,
    ) -> Result<Numbers<'a>, Error> {
        let numbers = match trajectory {
            Trajectory::Constant(value) => Numbers::Constant(value),
            Trajectory::Shared(values) => Numbers::Shared(values),
            Trajectory::EachRun(values) => Numbers::EachRun(values),
            Trajectory::Sampled { times, values } => {
                let grid = Grid::of(name, times, self.time)?;
                Numbers::Sampled { grid, times, values, is_held, is_each: values.len() > times.len() }
            }
            Trajectory::RateOf(other) => {
                return request(format!(
                    "{name} is the derivative of {other}; derivatives of other inputs are for continuous inputs in Model Exchange"
                ));
            }
            Trajectory::Value(_) | Trajectory::Values(_) | Trajectory::SampledValues { .. } => {
                return request(format!("{name} is a number; give its values as numbers"));
            }
        };
        let values = match &numbers {
            Numbers::Constant(value) => std::slice::from_ref(value),
            Numbers::Shared(values) if values.len() != self.time.len() => {
                return request(format!("{name} has {} values for {} times", values.len(), self.time.len()));
            }
            Numbers::Shared(values) | Numbers::EachRun(values) | Numbers::Sampled { values, .. } => values,
        };
        fits(name, base, values)?;
        Ok(numbers)
    }
}

/// Finds an input, or another variable that may change during a run.
pub(super) fn input<'s>(system: &'s System, name: &str) -> Result<Vec<Found<'s>>, Error> {
    let variables = system.find(name)?;
    variables.iter().try_for_each(|found| found.check_own(name))?;
    let of = variables[0].variable;
    if !of.is_settable() || of.is_structural() || of.variability.as_deref() == Some("fixed") {
        return request(format!(
            "{name} is no input but {} {}; give it a start value",
            article(of.variability.as_deref().unwrap_or(&of.causality)),
            of.causality
        ));
    }
    Ok(variables)
}

/// Returns whether a variable keeps its value between the times at which it is given.
pub(super) fn is_held(of: &Variable) -> bool {
    !of.base.is_float() || of.variability.as_deref().is_some_and(|of| of != "continuous")
}

/// Fails if settings of Model Exchange are given for Co-Simulation.
fn check_of_co_simulation(batch: &Batch) -> Result<(), Error> {
    if batch.events || batch.integration != Integration::default() {
        return request(
            "solver, rtol, atol, max_step and events are for Model Exchange; in Co-Simulation the FMU has its own solver, see tolerance"
                .to_owned(),
        );
    }
    Ok(())
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
    let trajectories =
        batch.inputs.iter().chain(&batch.input_derivatives).filter_map(|(name, trajectory)| {
            let (length, times) = trajectory.counts(batch.time.len())?;
            let is_each = matches!(trajectory, Trajectory::EachRun(_)) || length > times;
            (is_each && !matches!(trajectory, Trajectory::Shared(_))).then_some((*name, length, times))
        });
    let starts = batch.start.iter().filter_map(|(name, start)| Some((*name, start.count()?, 1)));
    for (name, length, times) in trajectories.chain(starts) {
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

pub(super) fn once<'a>(names: &mut Vec<&'a str>, name: &'a str, list: &str) -> Result<(), Error> {
    if names.contains(&name) {
        return request(format!("{name} is twice among the {list}"));
    }
    names.push(name);
    Ok(())
}
