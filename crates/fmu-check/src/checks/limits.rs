//! Checks simulations with a value at a limit of its range, and a simulation up to the stop time. There a model divides by zero, takes a
//! root of a negative number, leaves a table, or counts further than its type can.

use crate::call_sequence::{CallSequence, End, Run, Values};
use crate::checker::Checker;
use crate::description::{Description, Variable};
use crate::finding::failure_of;
use crate::trajectory::{range, step_size};
use crate::values::inputs_by;
use crate::writer::{MAX_READ, Read, Trajectory, Writer, not_finite};
use fmi_abi::Causality;

/// Number of steps of a simulation at a limit.
const STEPS: usize = 12;

/// Most steps of the simulation up to the stop time, more than a counter of 8 bits can count.
const MOST_STEPS: f64 = 400.0;

/// A limit that a magnitude exceeds by this factor is no limit of the model, but only the largest number of the tool that wrote the file.
const FAR: f64 = 1e9;

/// What differs from the usual simulation.
enum Change {
    Nothing,
    /// Values of a variable, set before the initialization.
    Set(usize, Values),
    /// Continuous states, set after the initialization of Model Exchange.
    States(Vec<f64>),
}

/// Simulation in which all values are read after the initialization and after each step.
struct Simulation {
    /// Calls other than reads, in their order.
    calls: Vec<u32>,
    reads: Vec<Read>,
}

impl Simulation {
    fn write(writer: &mut Writer, change: &Change) -> Self {
        let description = writer.description;
        let mut calls = vec![writer.make(0)];
        calls.extend(writer.set(0, &inputs_by(description, 0.5)));
        if let Change::Set(index, values) = change {
            calls.extend(writer.set(0, &[(*index, values.clone())]));
        }
        calls.push(writer.enter(0));
        calls.extend(writer.leave(0));
        if let Change::States(states) = change {
            calls.push(writer.set_states(0, states));
        }
        let mut reads = writer.read_all(0);
        for number in 0..STEPS {
            calls.push(writer.advance(0, description.start_time, step_size(description), number));
            reads.extend(writer.read_all(0));
        }
        writer.free(0);
        Self { calls, reads }
    }

    /// Describes a call that returns Fatal, or a value that cannot be read or is not finite, although all other calls succeed. An error of
    /// these is no failure, because the model may reject a value that does not fit to others.
    fn failure(&self, run: &Run, sequence: &CallSequence, description: &Description) -> Option<String> {
        let reads = self.reads.iter().map(|read| read.id);
        let fatal = self.calls.iter().copied().chain(reads.clone()).filter(|id| run.status(*id) == Some(4));
        if let Some(id) = fatal.min() {
            return failure_of(sequence, run, id);
        }
        if !self.calls.iter().all(|id| run.succeeds(*id)) {
            return None;
        }
        let unreadable = reads.filter(|id| !run.succeeds(*id)).find_map(|id| failure_of(sequence, run, id));
        unreadable.or_else(|| {
            let (index, value) = not_finite(run, &self.reads, description)?;
            Some(format!("{} is {value:?}", description.variables[index].name))
        })
    }
}

/// Returns the limits of the range of a variable that differ from its start value, each with the name of its attribute.
fn limits_of(variable: &Variable) -> impl Iterator<Item = (&'static str, f64)> {
    let starts = variable.starts();
    let scale = starts.iter().fold(variable.nominal(), |most, start| most.max(start.abs()));
    [("min", variable.min()), ("max", variable.max())].into_iter().filter_map(move |(name, limit)| {
        let limit = limit.filter(|limit| limit.abs() < FAR * scale)?;
        starts.iter().any(|start| *start != limit).then_some((name, limit))
    })
}

/// Returns the changes, each with its description: a parameter or an input at a limit, or in Model Exchange a continuous state.
fn changes(description: &Description, trajectory: &Trajectory, most: usize) -> Vec<(String, Change)> {
    let mut changes = Vec::new();
    let is_set = |variable: &Variable| {
        [Causality::Parameter, Causality::Input].contains(&variable.causality)
            && variable.is_number()
            && !variable.clocked
            && variable.size == Some(variable.starts_count())
    };
    let variables = description.variables.iter().enumerate();
    for (index, variable) in variables.filter(|(_, variable)| is_set(variable)).take(most) {
        for (name, limit) in limits_of(variable) {
            let values = Values::new(description.kind(index), variable.starts().iter().map(|_| limit));
            changes.push((format!("{} is {limit:?}, its {name}", variable.name), Change::Set(index, values)));
        }
    }
    let point = trajectory.points.iter().find(|point| !point.states.is_empty());
    let states =
        description.derivatives.iter().map(|unknown| description.variables[unknown.variable].derivative_of);
    if let (Some(point), Some(states)) = (point, states.collect::<Option<Vec<usize>>>())
        && states.len() == point.states.len()
    {
        for (position, state) in states.into_iter().enumerate().take(most) {
            let variable = &description.variables[state];
            for (name, limit) in limits_of(variable) {
                let mut states = point.states.clone();
                states[position] = limit;
                let change = Change::States(states);
                changes.push((format!("the state {} is {limit:?}, its {name}", variable.name), change));
            }
        }
    }
    changes
}

/// Simulates with each parameter, input and state at the limits of its range, one at a time.
pub fn ranges(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    // Steps with Event Mode would have to handle events.
    if trajectory.is_stepped() && description.event_mode() || description.variables.len() > MAX_READ {
        return Ok(());
    }
    // A simulation that fails anyway shows nothing.
    let mut writer = checker.writer(trajectory);
    let usual = Simulation::write(&mut writer, &Change::Nothing);
    let run = checker.execute(&writer.sequence)?;
    if run.end != End::Done || usual.failure(&run, &writer.sequence, description).is_some() {
        return Ok(());
    }
    for (what, change) in changes(description, trajectory, checker.at_most(400)) {
        let mut writer = checker.writer(trajectory);
        let changed = Simulation::write(&mut writer, &change);
        let (description, sequence) = (description.clone(), writer.sequence.clone());
        checker.check("dynamics.limits", writer.sequence, move |run| {
            changed.failure(run, &sequence, &description).map(|failure| format!("if {what}, {failure}"))
        })?;
    }
    Ok(())
}

/// Simulates the default experiment to its end.
pub fn stop_time(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    if trajectory.is_stepped() && description.event_mode() || description.stop_time.is_none() {
        return Ok(());
    }
    let count = (range(description) / step_size(description)).round().clamp(1.0, MOST_STEPS);
    let size = range(description) / count;
    let mut writer = checker.writer(trajectory);
    let mut calls = writer.begin(0);
    calls.extend((0..count as usize).map(|number| writer.advance(0, description.start_time, size, number)));
    let reads = writer.read_all(0);
    writer.free(0);
    let sequence = writer.sequence;
    let simulation = Simulation { calls, reads };
    let (description, all) = (description.clone(), sequence.clone());
    let criterion = move |run: &Run| simulation.failure(run, &all, &description);
    // The experiment may take minutes.
    let run = checker.workers.execute(&checker.setting, &sequence, checker.limit.min(5.0))?;
    match run.end {
        End::Hang(_) => Ok(()),
        End::Done => {
            checker.record_always(&sequence, &run);
            checker.record("dynamics.stop-time", &run, &sequence, criterion);
            Ok(())
        }
        _ => checker.check("dynamics.stop-time", sequence, criterion),
    }
}
