//! Checks that ModelStructure lists the dependencies that the FMU has.

use super::derivatives::{middle_values, set_known, to_middle};
use crate::checker::Checker;
use crate::description::Unknown;
use crate::values::near;
use crate::writer::Part::{Enter, Make};
use crate::writer::{Read, Trajectory, Writer, value_of};
use std::collections::HashSet;

/// Returns the variables of the unknowns whose `dependencies` attribute contains neither the known nor an alias of it.
fn undeclared<'a>(
    checker: &Checker,
    unknowns: impl IntoIterator<Item = &'a Unknown>,
    known: usize,
) -> Vec<usize> {
    let aliases: HashSet<usize> = checker.description.aliases(known).collect();
    let silent = |unknown: &&Unknown| {
        let lists = |list: &Vec<usize>| list.iter().any(|index| aliases.contains(index));
        unknown.dependencies.as_ref().is_some_and(|list| !lists(list))
    };
    let silent = unknowns.into_iter().filter(silent).map(|unknown| unknown.variable);
    silent.filter(|index| !aliases.contains(index)).collect()
}

/// Checks that no unknown depends on the known. The known is set to `value`, to another value and to `value` again. An unknown
/// that changes and has its first value at the end depends on the known.
fn moved(
    checker: &Checker,
    rule: &str,
    mut writer: Writer,
    known: usize,
    value: &[f64],
    unknowns: Vec<usize>,
    set: impl Fn(&mut Writer, &[f64]),
) -> anyhow::Result<()> {
    let variable = &checker.description.variables[known];
    let other: Vec<f64> = value.iter().map(|value| near(variable, *value, 1.0 / 16.0)).collect();
    let [before, after, back]: [Vec<Read>; 3] = [value, &other[..], value].map(|value| {
        set(&mut writer, value);
        writer.read_these(0, &unknowns)
    });
    let description = checker.description.clone();
    checker.check(rule, writer.sequence, move |run| {
        unknowns.iter().find_map(|unknown| {
            let [one, other, again] = [&before, &after, &back].map(|reads| value_of(run, reads, *unknown));
            let (one, other, again) = (one?, other?, again?);
            let at = one.differ(&other)?;
            let (name, of) = (&description.variables[*unknown].name, &description.variables[known].name);
            let (is, becomes) = (one.show(at), other.show(at));
            let message =
                || format!("{name} goes from {is} to {becomes} when {of} changes, and does not list it");
            one.differ(&again).is_none().then(message)
        })
    })
}

/// Checks the dependencies of outputs and derivatives on continuous inputs and, in Model Exchange, on states.
pub fn missing(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let stepped = trajectory.is_stepped();
    let derivatives = if stepped { &[][..] } else { &description.derivatives };
    let scalar = !stepped && description.states_count() == Some(description.states().len());
    let states = if scalar { description.states() } else { Vec::new() };
    let inputs = (0..description.variables.len()).filter(|index| {
        let variable = &description.variables[*index];
        variable.causality == "input"
            && variable.is_float()
            && variable.variability == "continuous"
            && !variable.once_per_instant
            && !variable.clocked
    });
    let knowns: Vec<usize> = inputs.chain(states.iter().copied()).take(checker.at_most(60)).collect();
    let (values, vector) = middle_values(checker, trajectory, &knowns, &states)?;
    for (known, value) in knowns.into_iter().zip(values) {
        let unknowns = undeclared(checker, description.outputs.iter().chain(derivatives), known);
        if unknowns.is_empty() || value.is_empty() {
            continue;
        }
        let mut writer = checker.writer(trajectory);
        writer.write(0, &to_middle(trajectory));
        moved(checker, "dependencies.missing", writer, known, &value, unknowns, |writer, numbers| {
            set_known(writer, &states, &vector, known, numbers);
        })?;
    }
    Ok(())
}

/// Checks the dependencies of initial unknowns on inputs and exact start values, except parameters, in Initialization Mode.
pub fn initial(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let knowns = (0..description.variables.len()).filter(|index| {
        let variable = &description.variables[*index];
        let known = variable.causality == "input"
            || variable.initial == "exact" && variable.variability != "constant";
        known
            && variable.is_float()
            && variable.causality != "parameter"
            && !variable.starts().is_empty()
            && !variable.clocked
    });
    for known in knowns.take(checker.at_most(60)) {
        let unknowns = undeclared(checker, &description.initial_unknowns, known);
        if unknowns.is_empty() {
            continue;
        }
        let mut writer = checker.writer(trajectory);
        writer.write(0, &[Make, Enter]);
        let value = description.variables[known].starts();
        moved(checker, "dependencies.initial", writer, known, &value, unknowns, |writer, numbers| {
            writer.set_numbers(0, known, numbers);
        })?;
    }
    Ok(())
}
