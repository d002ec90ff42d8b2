//! Saves the state of an instance for Co-Simulation on the way, restores it, and goes on.

use super::{Motion, Run};
use crate::inputs::is_exact;
use anyhow::Result;
use fmi_abi::Causality;
use fmu_run::{
    Description, Fmu, Instances, Interface, Occurrence, Selection, Setup, Start, Trajectory, Value,
};
use std::collections::BTreeSet;
use std::fmt;

/// What is wrong with the saved states.
pub enum Mistake {
    /// Two runs with the same inputs differ, so saved states cannot be examined.
    Random(String),
    /// A state that was saved in the memory of the process lacks something.
    Copied(String),
    /// A state that was serialized to bytes lacks something.
    Serialized(String),
}

impl fmt::Display for Mistake {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Random(text) => write!(
                f,
                "two runs with the same inputs differ: {text}; random numbers, the clock of the computer and a `static` that another \
                 instance has changed must not enter the results"
            ),
            Self::Copied(text) => write!(
                f,
                "{text}; `Clone` must copy every field, and values that change must not be outside the model or shared, as in a `static`, \
                 a `OnceLock` or an `Rc`"
            ),
            Self::Serialized(text) => write!(
                f,
                "{text}; name every field that initialize, a step or an event changes after `memory in` of variables!"
            ),
        }
    }
}

/// Number of instants, apart from events, at which the state is saved.
const INSTANTS: usize = 10;
/// Maximum number of events before and after which the state is saved.
const MOST_EVENTS: usize = 15;
/// Maximum number of variables that are read at each communication point, and of all values.
const MOST: [usize; 2] = [1000, 20_000_000];

/// Saves the state at several instants and around events, also as bytes. Then restores these states, the last one first, and compares the
/// results of the following steps with those before. Returns `None` if they are the same, or if the FMU cannot save its state.
///
/// `stepped` is the run for Co-Simulation: its last variables are the numeric inputs, with these names. `events` are those of Model
/// Exchange.
pub fn examine(
    fmu: &Fmu,
    motion: &Motion,
    numeric: &[&str],
    stepped: &Run,
    events: &[Occurrence],
) -> Result<Option<Mistake>> {
    let description = fmu.description();
    let saves = description.offer(Interface::CoSimulation).is_some_and(|offer| offer.saves_states);
    let (compared, inputs) = stepped.values.split_at(stepped.values.len() - numeric.len());
    let reached =
        compared.iter().chain(inputs).map(|values| values.iter().take_while(|of| of.is_finite()).count());
    let steps = reached.min().unwrap_or(motion.time.len()).saturating_sub(1);
    if !saves || stepped.error.is_some() || steps < 2 {
        return Ok(None);
    }
    let mut walk = Walk::new(fmu, motion, numeric, inputs)?;
    let instants = instants(motion.time, steps, events);
    let serializes = description.offer(Interface::CoSimulation).is_some_and(|offer| offer.serializes_states);
    let (mut saved, mut before) = (Vec::new(), Vec::new());
    for step in 0..steps {
        if instants.contains(&step) {
            let state = walk.instances.save()?;
            let bytes = serializes.then(|| walk.instances.serialize(&state)).transpose()?;
            saved.push((step, state, bytes));
        }
        match walk.step(step)? {
            Some(row) => before.push(row),
            None => break,
        }
    }
    if let Some(difference) = walk.first_difference(&before, compared) {
        return Ok(Some(Mistake::Random(difference)));
    }
    let mut end = before.len();
    for (from, state, _) in saved.iter().rev() {
        walk.instances.restore(state, None)?;
        if let Some(text) = walk.again(&before[..end], *from)? {
            return Ok(Some(Mistake::Copied(text)));
        }
        end = *from;
    }
    // What the bytes lack keeps the value that it has in the instance, which belongs to a later time.
    let mut end = before.len();
    for (from, bytes) in saved.iter().rev().filter_map(|(from, _, bytes)| Some((from, bytes.as_ref()?))) {
        let state = walk.instances.deserialize(bytes)?;
        walk.instances.restore(&state, None)?;
        walk.instances.forget(state);
        if let Some(text) = walk.again(&before[..end], *from)? {
            return Ok(Some(Mistake::Serialized(text)));
        }
        end = *from;
    }
    Ok(None)
}

/// Returns the indices of the communication points at which the state is saved.
fn instants(time: &[f64], steps: usize, events: &[Occurrence]) -> BTreeSet<usize> {
    let ends: BTreeSet<usize> =
        events.iter().map(|event| time.partition_point(|time| *time < event.time)).collect();
    let chosen = ends.iter().step_by(ends.len().div_ceil(MOST_EVENTS).max(1));
    let around = chosen.flat_map(|end| [end.saturating_sub(1), *end]);
    let even = (1..=INSTANTS).map(|number| number * steps / (INSTANTS + 1));
    around.chain(even).filter(|at| (1..steps).contains(at)).collect()
}

/// The values at a communication point: numbers, and values that an `f64` cannot hold.
type Row = (Vec<f64>, Vec<Option<Value>>);

/// An input whose values an `f64` cannot hold, over time.
type ExactInput<'a> = (&'a str, &'a [f64], &'a [Value]);

/// An instance that follows the motion.
struct Walk<'a> {
    instances: Instances,
    time: &'a [f64],
    set: Selection,
    inputs: &'a [Vec<f64>],
    exact_inputs: Vec<ExactInput<'a>>,
    read: Selection,
    exact: Vec<&'a str>,
}

impl<'a> Walk<'a> {
    fn new(fmu: &'a Fmu, motion: &Motion<'a>, numeric: &[&str], inputs: &'a [Vec<f64>]) -> Result<Self> {
        let exact_inputs: Vec<ExactInput> = motion
            .table
            .trajectories()
            .into_iter()
            .filter_map(|(name, trajectory)| match trajectory {
                Trajectory::SampledValues { times, values } => Some((name, times, values)),
                _ => None,
            })
            .collect();
        let of_numbers = numeric.iter().zip(inputs).map(|(name, values)| (*name, Start::Same(values[0])));
        let of_values =
            exact_inputs.iter().map(|input| (input.0, Start::Value(value_at(input, motion.time[0]))));
        let is_input =
            |name: &str| numeric.contains(&name) || exact_inputs.iter().any(|input| input.0 == name);
        let given = motion.starts.iter().filter(|(name, _)| !is_input(name));
        let given = given.map(|(name, value)| (name.as_str(), Start::Value(value)));
        let setup = Setup {
            start: given.chain(of_numbers).chain(of_values).collect(),
            start_time: motion.time[0],
            stop_time: motion.time.last().copied(),
            ..Setup::default()
        };
        let instances = fmu.system().instances(&setup)?;
        let most = MOST[0].min(MOST[1] / motion.time.len());
        let [read, exact] = [false, true].map(|exact| readable(fmu.description(), exact, most));
        let (set, read) = (fmu.system().select(numeric)?, fmu.system().select(&read)?);
        Ok(Self { instances, time: motion.time, set, inputs, exact_inputs, read, exact })
    }

    /// Sets the inputs at a communication point, reads all variables and performs a step. Returns `None` if the instance has failed.
    fn step(&mut self, step: usize) -> Result<Option<Row>> {
        let inputs: Vec<f64> = self.inputs.iter().map(|values| values[step]).collect();
        self.instances.set(&self.set, &inputs, None)?;
        for input in &self.exact_inputs {
            let value = value_at(input, self.time[step]).clone();
            self.instances.set_values(input.0, &[value], None)?;
        }
        let mut row = vec![0.0; self.read.len()];
        self.instances.get(&self.read, &mut row);
        let exact = self.exact.iter().map(|name| Ok(self.instances.values(name)?.remove(0)));
        let exact = exact.collect::<Result<Vec<_>>>()?;
        self.instances.step_to(self.time[step + 1], None)?;
        Ok(self.instances.none_left().is_none().then_some((row, exact)))
    }

    /// Repeats the steps from the index `from` on, after a state was restored, and describes the first difference from the rows before.
    fn again(&mut self, before: &[Row], from: usize) -> Result<Option<String>> {
        let saved = self.time[from];
        for (step, before) in before.iter().enumerate().skip(from) {
            let Some(row) = self.step(step)? else {
                let why = self.instances.none_left().unwrap_or_default();
                return Ok(Some(format!(
                    "a run that continues from the state saved at {saved} s fails: {why}"
                )));
            };
            if let Some((name, was, is)) = self.difference(before, &row) {
                let at = self.time[step];
                return Ok(Some(format!(
                    "in a run that continues from the state saved at {saved} s, {name} is {is} at {at} s instead of {was}"
                )));
            }
        }
        Ok(None)
    }

    /// Returns the first variable that differs, with both values.
    fn difference(&self, one: &Row, other: &Row) -> Option<(&str, String, String)> {
        let is_other = |index: &usize| {
            let [one, other] = [one.0[*index], other.0[*index]];
            one != other && !(one.is_nan() && other.is_nan())
        };
        let number = (0..one.0.len()).find(is_other).map(|index| {
            (self.read.names()[index].as_str(), one.0[index].to_string(), other.0[index].to_string())
        });
        number.or_else(|| {
            let index = (0..one.1.len()).find(|index| one.1[*index] != other.1[*index])?;
            let [one, other] =
                [one, other].map(|row| row.1[index].as_ref().map_or_else(String::new, Value::to_string));
            Some((self.exact[index], format!("{one:?}"), format!("{other:?}")))
        })
    }

    /// Describes the first difference from the values of another run, whose variables are the first ones of this one.
    fn first_difference(&self, rows: &[Row], others: &[Vec<f64>]) -> Option<String> {
        rows.iter().enumerate().find_map(|(step, row)| {
            let other = (others.iter().map(|values| values[step]).collect(), row.1.clone());
            let same = (row.0[..others.len().min(row.0.len())].to_vec(), row.1.clone());
            let (name, one, other) = self.difference(&same, &other)?;
            Some(format!("{name} is {other} and {one} at {} s", self.time[step]))
        })
    }
}

/// Returns the last value that is not after this time.
fn value_at<'a>(&(_, times, values): &ExactInput<'a>, time: f64) -> &'a Value {
    &values[times.partition_point(|of| *of <= time).saturating_sub(1)]
}

/// Returns the outputs and local variables: those that are compared first.
fn readable(description: &Description, exact: bool, most: usize) -> Vec<&str> {
    let compared = super::compared(description);
    let compared = compared.iter().filter(|_| !exact).map(|of| of.name.as_str());
    let is_read = |name: &&str| !compared.clone().any(|other| other == *name);
    let all = description
        .variables
        .iter()
        .filter(|of| matches!(of.causality, Causality::Output | Causality::Local) && is_exact(of) == exact);
    let others: Vec<&str> = all.map(|of| of.name.as_str()).filter(is_read).collect();
    compared.chain(others).take(most).collect()
}
