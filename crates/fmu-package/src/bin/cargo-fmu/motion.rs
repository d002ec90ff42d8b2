//! Compares Co-Simulation with Model Exchange of an FMU that the author has made, on the author's own motion.
//!
//! The comparison at the default inputs, which `cargo fmu build` makes, cannot find mistakes in events that do not occur there.

use crate::inputs::{Table, is_exact};
use anyhow::Result;
use fmi_abi::Causality;
use fmu_run::{
    BaseType, Batch, Description, Fmu, Integration, Interface, Occurrence, Runs, Start, Trajectory, Value,
    Variable, Watch,
};
use std::collections::HashSet;
use std::fmt;

/// A motion: communication points, inputs and start values.
pub struct Motion<'a> {
    pub time: &'a [f64],
    pub table: &'a Table,
    pub starts: &'a [(String, Value)],
}

/// Result of a comparison.
pub enum Comparison {
    /// The largest difference: a variable with its unit, the difference and the time.
    Agree(Option<(String, f64, f64)>),
    /// What differs first, and a possible reason.
    Differ(String),
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let equal = "Co-Simulation and Model Exchange agree";
        match self {
            Self::Agree(None) => f.write_str(equal),
            Self::Agree(Some((name, difference, time))) => {
                write!(f, "{equal}: {name} differs most, by {difference:.1e} at {time} s")
            }
            Self::Differ(text) => write!(f, "Co-Simulation and Model Exchange differ {text}"),
        }
    }
}

/// Largest difference, relative to the range of a variable, that may be an error of a solver.
const TOLERANCE: f64 = 1e-3;
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

/// Compares the interface types. Returns `None` if the FMU has only one, or no variable that can be compared.
pub fn compare(fmu: &Fmu, motion: &Motion) -> Result<Option<Comparison>> {
    let description = fmu.description();
    let has = |interface| description.offer(interface).is_some();
    let compared = compared(description);
    if !has(Interface::CoSimulation) || !has(Interface::ModelExchange) || compared.is_empty() {
        return Ok(None);
    }
    let moved: Vec<_> = motion.table.trajectories();
    let is_number = |name: &str| description.variable(name).is_some_and(|variable| !is_exact(variable));
    let numeric: Vec<&str> = moved.iter().map(|(name, _)| *name).filter(|name| is_number(name)).collect();
    // The inputs are read, too, because Co-Simulation holds the values that they have at the communication points.
    let names: Vec<&str> =
        compared.iter().map(|variable| variable.name.as_str()).chain(numeric.iter().copied()).collect();
    let run = |interface, time: &[f64], inputs: &[(&str, Trajectory)], outputs: &[&str]| -> Result<Run> {
        let integrates = interface == Interface::ModelExchange;
        let batch = Batch {
            time,
            inputs: inputs.to_vec(),
            start: motion.starts.iter().map(|(name, value)| (name.as_str(), Start::Value(value))).collect(),
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
        Ok(Run {
            values: trajectories.chunks(time.len()).map(<[f64]>::to_vec).collect(),
            ended,
            events,
            error,
        })
    };
    let time = motion.time;
    let stepped = run(Interface::CoSimulation, time, &moved, &names)?;
    let (times, held) = held(time, &stepped.values[compared.len()..]);
    let mut staircase = moved.clone();
    for (name, trajectory) in &mut staircase {
        if let Some(number) = numeric.iter().position(|other| other == name) {
            *trajectory = Trajectory::Sampled { times: &times, values: &held[number] };
        }
    }
    let names = &names[..compared.len()];
    let integrated = run(Interface::ModelExchange, time, &staircase, names)?;
    // A model may interpolate its inputs in Co-Simulation.
    let lines = run(Interface::ModelExchange, time, &moved, names)?;
    // Results of half the step size show the error of the steps. A model may reject other step sizes.
    let halves: Vec<f64> = time.windows(2).flat_map(|pair| [pair[0], 0.5 * (pair[0] + pair[1])]).collect();
    let halves = [&halves[..], &time[time.len() - 1..]].concat();
    let half = run(Interface::CoSimulation, &halves, &staircase, names)?;
    let judged =
        Judged { time, compared: &compared, stepped, integrated, lines, half, description, moved: &numeric };
    Ok(Some(judged.comparison()))
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

/// Returns the inputs as Co-Simulation holds them, with a jump at each communication point.
fn held(time: &[f64], inputs: &[Vec<f64>]) -> (Vec<f64>, Vec<Vec<f64>>) {
    let twice = |values: &[f64]| values.iter().flat_map(|value| [*value; 2]).collect::<Vec<f64>>();
    let times = twice(time)[1..].to_vec();
    // Values after the end of a run are unknown, and not used.
    let known = |values: &Vec<f64>| {
        let mut last = 0.0;
        values
            .iter()
            .map(|value| {
                if value.is_finite() {
                    last = *value;
                }
                last
            })
            .collect::<Vec<f64>>()
    };
    (
        times,
        inputs
            .iter()
            .map(|values| {
                let mut values = twice(&known(values));
                values.pop();
                values
            })
            .collect(),
    )
}

/// Results of the runs of both interface types.
struct Judged<'a> {
    time: &'a [f64],
    compared: &'a [&'a Variable],
    stepped: Run,
    /// Model Exchange with the inputs of Co-Simulation, which are held between communication points.
    integrated: Run,
    /// Model Exchange with continuous inputs that follow lines.
    lines: Run,
    /// Co-Simulation with half the step size.
    half: Run,
    description: &'a Description,
    moved: &'a [&'a str],
}

impl Judged<'_> {
    fn comparison(&self) -> Comparison {
        for (run, name) in [(&self.stepped, "Co-Simulation"), (&self.integrated, "Model Exchange")] {
            if let Some(error) = &run.error {
                return Comparison::Differ(format!("because {name} fails: {error}"));
            }
        }
        let first = (0..self.compared.len()).filter_map(|of| Some((self.parts(of)?, of)));
        // Several variables may differ from the same time on.
        let first = first.min_by(|(one, a), (other, b)| {
            one.cmp(other).then(self.share(*other, *b).total_cmp(&self.share(*one, *a)))
        });
        if let Some((at, of)) = first {
            let [stepped, integrated] =
                [&self.stepped, &self.integrated].map(|run| self.shown(of, run.values[of][at]));
            let (name, time) = (&self.compared[of].name, self.time[at]);
            return Comparison::Differ(format!(
                "from {time} s on: {name} is {stepped} in Co-Simulation and {integrated} in Model Exchange; {}",
                self.reason(at, of)
            ));
        }
        let [stepped, integrated] = [&self.stepped, &self.integrated].map(|run| run.ended);
        let step = self.time[1] - self.time[0];
        if stepped.unwrap_or(f64::INFINITY) != integrated.unwrap_or(f64::INFINITY)
            && !matches!((stepped, integrated), (Some(one), Some(other)) if (one - other).abs() <= step)
        {
            let end =
                |end: Option<f64>| end.map_or("does not end".to_owned(), |end| format!("ends at {end} s"));
            return Comparison::Differ(format!(
                "in the end of the simulation: Co-Simulation {}, Model Exchange {}; compare `Stepped::Terminate` in `step` with \
                 `terminate` in `event`",
                end(stepped),
                end(integrated)
            ));
        }
        let most = (0..self.compared.len()).filter_map(|of| {
            let times: Vec<usize> = self.indices(of).collect();
            let lasting = times.windows(2).map(|pair| (self.lasting(pair, of), pair[1]));
            let (difference, at) = lasting.max_by(|one, other| one.0.total_cmp(&other.0))?;
            Some((difference / self.range(of), of, difference, at))
        });
        let most = most.max_by(|one, other| one.0.total_cmp(&other.0)).filter(|most| most.0 > 0.0);
        Comparison::Agree(
            most.map(|(_, of, difference, at)| (self.compared[of].name.clone(), difference, self.time[at])),
        )
    }

    /// Returns the difference that lasts from one time to the next. At a single time, an event near it may be handled before it in one
    /// interface type and after it in the other.
    fn lasting(&self, pair: &[usize], of: usize) -> f64 {
        self.difference(pair[0], of).min(self.difference(pair[1], of))
    }

    /// Returns the indices of the times at which a variable has a value in both runs.
    fn indices(&self, of: usize) -> impl Iterator<Item = usize> + '_ {
        let [stepped, integrated] = [&self.stepped, &self.integrated].map(|run| &run.values[of]);
        (0..self.time.len()).filter(move |at| stepped[*at].is_finite() && integrated[*at].is_finite())
    }

    fn difference(&self, at: usize, of: usize) -> f64 {
        let stepped = self.stepped.values[of][at];
        let lines = self.lines.values[of][at];
        let held = (stepped - self.integrated.values[of][at]).abs();
        if lines.is_finite() { held.min((stepped - lines).abs()) } else { held }
    }

    /// Returns the range of a variable in both runs.
    fn range(&self, of: usize) -> f64 {
        let values =
            || [&self.stepped, &self.integrated].into_iter().flat_map(|run| &run.values[of]).copied();
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        (high - low).max(1e-6 * high.abs().max(low.abs())).max(f64::MIN_POSITIVE)
    }

    /// Returns a difference as a share of the range.
    fn share(&self, at: usize, of: usize) -> f64 {
        self.difference(at, of) / self.range(of)
    }

    /// Returns the index of the time from which on a variable differs by more than the errors of solvers explain, at two times or more.
    fn parts(&self, of: usize) -> Option<usize> {
        let is_number = self.compared[of].base.is_float();
        let allowed = if is_number { TOLERANCE * self.range(of) } else { 0.0 };
        let (mut error, mut before) = (0.0_f64, None);
        for at in self.indices(of) {
            let half = self.half.values[of].get(2 * at).copied().filter(|half| half.is_finite());
            if is_number && let Some(half) = half {
                error = error.max((half - self.stepped.values[of][at]).abs());
            }
            match before {
                _ if self.difference(at, of) <= allowed + 2.0 * error => before = None,
                Some(first) => return Some(first),
                None => before = Some(at),
            }
        }
        None
    }

    /// Returns a possible reason of a difference, as an instruction.
    fn reason(&self, at: usize, of: usize) -> String {
        let from = self.time[at.saturating_sub(2)];
        let [stepped, integrated] = [&self.stepped, &self.integrated].map(|run| &run.values[of]);
        // The times at which the results differ, and those of them at which Co-Simulation has the value that Model Exchange has a step
        // earlier.
        let tolerance = TOLERANCE * self.range(of);
        let differing: Vec<usize> =
            self.indices(of).skip(1).filter(|at| self.difference(*at, of) > tolerance).collect();
        let late = differing.iter().filter(|at| (stepped[**at] - integrated[**at - 1]).abs() <= tolerance);
        if 10 * late.count() >= 9 * differing.len() {
            return "Co-Simulation returns the value of the step before, so `calculate` or the end of `step` must update it".to_owned();
        }
        for (run, other, name) in [
            (&self.stepped, &self.integrated, "Co-Simulation"),
            (&self.integrated, &self.stepped, "Model Exchange"),
        ] {
            if let Some(end) = run.ended
                && end <= self.time[at]
                && other.ended.is_none_or(|other| other > end)
            {
                return format!("{name} has ended at {end} s");
            }
        }
        let is_effect = |event: &&Occurrence| {
            event.time >= from
                && event.time <= self.time[at]
                && event.time > self.time[0]
                && event.before != event.after
        };
        if let Some(event) = self.lines.events.iter().find(is_effect) {
            return format!(
                "Model Exchange has an event at {} s, which `step` misses, or handles at another time or in another way: compare its condition and the direction \
                 of the crossing with `event`",
                event.time
            );
        }
        let change = |values: &[f64], at: usize| (values[at] - values[at.saturating_sub(1)]).abs();
        if at > 1 && change(stepped, at) > 10.0 * change(stepped, at - 1).max(change(integrated, at)) {
            return "Co-Simulation jumps there, and Model Exchange has no event: compare the event in `step` with `indicators`, whose \
                    sign must change"
                .to_owned();
        }
        let missing = self
            .description
            .variables
            .iter()
            .filter(|of| of.causality == Causality::Input && of.base == BaseType::Real);
        let missing: Vec<&str> =
            missing.map(|of| of.name.as_str()).filter(|name| !self.moved.contains(name)).collect();
        let missing = match missing.is_empty() {
            true => String::new(),
            false => {
                format!("; the table has no column for {}, which one of them may need", missing.join(", "))
            }
        };
        format!("no event is near, so compare the equations of `step` with the derivatives{missing}")
    }

    fn shown(&self, of: usize, value: f64) -> String {
        let unit = self.compared[of].unit.as_deref().map_or(String::new(), |unit| format!(" {unit}"));
        format!("{value}{unit}")
    }
}
