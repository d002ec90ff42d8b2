//! Mistakes in the events of Model Exchange.

use super::{Run, is_discrete};
use crate::inputs::is_exact;
use fmu_run::{BaseType, Description, ModelDescription, Occurrence, Variable};

/// Maximum number of local discrete variables that are read.
const MOST_LOCALS: usize = 1000;

/// Returns the variables to read in a run: those that are compared, then other discrete variables.
pub fn watched<'a>(description: &'a Description, compared: &[&'a Variable]) -> Vec<&'a Variable> {
    let is_other = |of: &&Variable| {
        is_discrete(of) && !is_exact(of) && !compared.iter().any(|other| other.name == of.name)
    };
    let others = description.variables.iter().filter(is_other).take(MOST_LOCALS);
    compared.iter().copied().chain(others).collect()
}

/// Returns the first mistake of each kind. `watched` are the variables of the run.
pub fn mistakes(description: &Description, run: &Run, time: &[f64], watched: &[&Variable]) -> Vec<String> {
    let indices = (0..watched.len()).filter(|index| is_discrete(watched[*index]));
    let changes = indices.filter_map(|index| Some((index, change(run, time, index)?)));
    let first = changes.min_by(|(_, one), (_, other)| one.time.total_cmp(&other.time)).map(|(index, change)| {
        let name = &watched[index].name;
        let [was, is] = [change.was, change.is].map(|value| shown(watched[index], value));
        format!(
            "in Model Exchange {name} changes from {was} to {is} before {} s, without an event; calculate it in `event`, and announce \
             the event with an indicator or `next`",
            change.time
        )
    });
    first.into_iter().chain(states(description, &run.events)).collect()
}

/// A change of a discrete variable that is not in an event.
struct Change {
    /// The time, s, at which it was found.
    time: f64,
    was: f64,
    is: f64,
}

/// Returns the first change of a discrete variable between two events.
fn change(run: &Run, time: &[f64], index: usize) -> Option<Change> {
    let values = &run.values[index];
    let mut events = run.events.iter().peekable();
    let mut was = values[0];
    let changed = |was: f64, is: f64| was != is && was.is_finite() && is.is_finite();
    for (time, value) in time.iter().zip(values).skip(1) {
        while let Some(event) = events.next_if(|event| event.time <= *time) {
            if changed(was, event.before[index]) {
                return Some(Change { time: event.time, was, is: event.before[index] });
            }
            was = event.after[index];
        }
        if changed(was, *value) {
            return Some(Change { time: *time, was, is: *value });
        }
    }
    None
}

fn shown(variable: &Variable, value: f64) -> String {
    match variable.base {
        BaseType::Boolean => (value != 0.0).to_string(),
        _ => value.to_string(),
    }
}

/// Describes an event that changes a state and does not report it, and one that changes a state that is declared without `reinit`.
fn states(description: &Description, events: &[Occurrence]) -> Vec<String> {
    let derivatives: Vec<_> = description.elements(&description.derivatives).collect();
    let state = |index: usize| Some(&description.variables[derivatives.get(index)?.derivative_of?]);
    let written: &ModelDescription = description;
    let is_declared = |of: &Variable| {
        let array = of.name.split('[').next().unwrap_or_default();
        written.variables.iter().any(|other| other.reinit && (other.name == of.name || other.name == array))
    };
    let jumps = events.iter().flat_map(|event| event.states.iter().map(move |index| (event, *index)));
    let jumps: Vec<_> = jumps.filter_map(|(event, index)| Some((event, state(index)?))).collect();
    let unreported = jumps.iter().find(|(event, _)| !event.states_changed).map(|(event, state)| {
        format!(
            "in Model Exchange the event at {} s changes the state {}, but does not report it; return `states_changed: true` from `event`",
            event.time, state.name
        )
    });
    let undeclared = jumps.iter().find(|(_, state)| !is_declared(state)).map(|(event, state)| {
        format!(
            "in Model Exchange the event at {} s changes the state {}; add `.reinit()` to its line of variables!, so that importers know \
             that it jumps",
            event.time, state.name
        )
    });
    unreported.into_iter().chain(undeclared).collect()
}
