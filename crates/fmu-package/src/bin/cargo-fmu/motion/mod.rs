//! Examines an FMU that the author has made, on the author's own motion: compares Co-Simulation with Model Exchange (`difference`), looks
//! at its events (`events`), and saves and restores its state on the way (`saved`).
//!
//! `cargo fmu build` makes the same comparisons at the default inputs, which cannot find mistakes in events that do not occur there.

mod difference;
mod events;
mod saved;

use crate::inputs::{Table, is_exact};
use anyhow::Result;
pub use difference::Comparison;
use difference::Judged;
use fmi_abi::Causality;
use fmu_run::{
    Batch, Description, Fmu, Integration, Interface, Occurrence, Runs, Start, Trajectory, Value, Variability,
    Variable, Watch,
};
use std::collections::HashSet;

/// A motion: communication points, inputs and start values.
pub struct Motion<'a> {
    pub time: &'a [f64],
    pub table: &'a Table,
    pub starts: &'a [(String, Value)],
}

/// What an FMU shows on a motion.
pub struct Examination {
    /// `None` if the FMU has only one interface type, or no variable that can be compared.
    pub comparison: Option<Comparison>,
    /// Mistakes that single interface types show.
    pub mistakes: Vec<String>,
}

/// Relative tolerance of the integration of Model Exchange.
const RTOL: f64 = 1e-8;

/// Values of the variables in a run, and when the FMU has ended it.
struct Run {
    /// For each variable, a value at each time; NaN after the end of the run.
    values: Vec<Vec<f64>>,
    ended: Option<f64>,
    events: Vec<Occurrence>,
    error: Option<String>,
}

impl Motion<'_> {
    /// Runs the FMU with these inputs.
    fn run(
        &self,
        fmu: &Fmu,
        interface: Interface,
        time: &[f64],
        inputs: &[(&str, Trajectory)],
        outputs: &[&str],
    ) -> Result<Run> {
        let integrates = interface == Interface::ModelExchange;
        let batch = Batch {
            time,
            inputs: inputs.to_vec(),
            start: self.starts.iter().map(|(name, value)| (name.as_str(), Start::Value(value))).collect(),
            outputs: outputs.to_vec(),
            every: Some(1),
            threads: Some(1),
            interface: Some(interface),
            integration: Integration { rtol: Some(RTOL).filter(|_| integrates), ..Integration::default() },
            events: integrates,
            ..Batch::default()
        };
        let watch = Watch::listening();
        let Runs { trajectories, errors, events, .. } = fmu.system().run(&batch, &watch)?;
        let ended = watch.ended().pop().map(|(_, end, _)| end);
        let error = errors.into_iter().next().map(|(_, reason)| reason).filter(|_| ended.is_none());
        let values = trajectories.chunks(time.len()).map(<[f64]>::to_vec).collect();
        Ok(Run { values, ended, events, error })
    }
}

/// Examines an FMU on a motion.
pub fn examine(fmu: &Fmu, motion: &Motion) -> Result<Examination> {
    let description = fmu.description();
    let has = |interface| description.offer(interface).is_some();
    let (compared, time) = (compared(description), motion.time);
    let moved: Vec<_> = motion.table.trajectories();
    let is_number = |name: &str| description.variable(name).is_some_and(|variable| !is_exact(variable));
    let numeric: Vec<&str> = moved.iter().map(|(name, _)| *name).filter(|name| is_number(name)).collect();
    let names: Vec<&str> = compared.iter().map(|variable| variable.name.as_str()).collect();
    // The inputs are read, too, because Co-Simulation holds the values that they have at the communication points.
    let stepped = has(Interface::CoSimulation)
        .then(|| motion.run(fmu, Interface::CoSimulation, time, &moved, &[&names[..], &numeric].concat()));
    let stepped = stepped.transpose()?;
    let (times, held) = match &stepped {
        Some(stepped) => held(time, &stepped.values[compared.len()..]),
        None => Default::default(),
    };
    let mut staircase = moved.clone();
    for (name, trajectory) in &mut staircase {
        if let Some(values) =
            numeric.iter().position(|other| other == name).and_then(|number| held.get(number))
        {
            *trajectory = Trajectory::Sampled { times: &times, values };
        }
    }
    let watched = events::watched(description, &compared);
    let of_watched: Vec<&str> = watched.iter().map(|variable| variable.name.as_str()).collect();
    let exchanged =
        |inputs: &[_], names: &[&str]| motion.run(fmu, Interface::ModelExchange, time, inputs, names);
    let integrated = has(Interface::ModelExchange).then(|| exchanged(&staircase, &of_watched)).transpose()?;
    let mut mistakes = Vec::new();
    if let Some(integrated) = &integrated {
        mistakes.extend(events::mistakes(description, integrated, time, &watched));
    }
    // A model may interpolate its inputs in Co-Simulation.
    let lines = (stepped.is_some() && integrated.is_some()).then(|| exchanged(&moved, &names)).transpose()?;
    let events = lines.as_ref().map_or(&[][..], |lines| &lines.events);
    let saved = stepped.as_ref().map(|stepped| saved::examine(fmu, motion, &numeric, stepped, events));
    let saved = saved.transpose()?.flatten();
    let comparison = match (stepped, integrated, lines) {
        (Some(stepped), Some(integrated), Some(lines)) if !compared.is_empty() => {
            // Results of half the step size show the error of the steps. A model may reject other step sizes.
            let halves: Vec<f64> =
                time.windows(2).flat_map(|pair| [pair[0], 0.5 * (pair[0] + pair[1])]).collect();
            let halves = [&halves[..], &time[time.len() - 1..]].concat();
            let half = motion.run(fmu, Interface::CoSimulation, &halves, &staircase, &names)?;
            let is_random = matches!(saved, Some(saved::Mistake::Random(_)));
            let (compared, moved) = (&compared[..], &numeric[..]);
            let judged =
                Judged { time, compared, stepped, integrated, lines, half, description, moved, is_random };
            Some(judged.comparison())
        }
        _ => None,
    };
    mistakes.extend(saved.map(|mistake| mistake.to_string()));
    Ok(Examination { comparison, mistakes })
}

/// Returns the variables that are compared: outputs and states.
fn compared(description: &Description) -> Vec<&Variable> {
    let variables = &description.variables;
    let derivatives = variables.iter().filter(|of| of.causality != Causality::Input);
    let states: HashSet<usize> = derivatives.filter_map(|of| of.derivative_of).collect();
    let is_compared = |(index, of): &(usize, &Variable)| {
        !is_exact(of)
            && (of.causality == Causality::Output
                || of.causality == Causality::Local && states.contains(index))
    };
    variables.iter().enumerate().filter(is_compared).map(|(_, of)| of).collect()
}

/// Returns whether the value of a variable may change only in events.
fn is_discrete(variable: &Variable) -> bool {
    variable.variability == Some(Variability::Discrete)
        && matches!(variable.causality, Causality::Output | Causality::Local)
}

/// Returns the inputs as Co-Simulation holds them, with a jump at each communication point.
fn held(time: &[f64], inputs: &[Vec<f64>]) -> (Vec<f64>, Vec<Vec<f64>>) {
    let twice = |values: &[f64]| values.iter().flat_map(|value| [*value; 2]).collect::<Vec<f64>>();
    let times = twice(time)[1..].to_vec();
    // Values after the end of a run are unknown, and not used.
    let known = |values: &Vec<f64>| {
        let mut last = 0.0;
        let known = values.iter().map(|value| {
            if value.is_finite() {
                last = *value;
            }
            last
        });
        known.collect::<Vec<f64>>()
    };
    let twice_each = inputs.iter().map(|values| {
        let mut values = twice(&known(values));
        values.pop();
        values
    });
    (times, twice_each.collect())
}
