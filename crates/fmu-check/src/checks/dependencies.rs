//! Dependencies that the FMU shows are declared.

use crate::call_sequence::Written;
use crate::checker::Checker;
use crate::finding::Judge;
use crate::values::{Value, near};
use crate::writer::{Read, value_of};
use fmi_abi::Interface;
use std::collections::HashSet;
use std::sync::Arc;

/// The unknowns that do not list a known, nor another name of it.
fn undeclared(checker: &Checker, unknowns: &[crate::description::Unknown], known: usize) -> Vec<usize> {
    let aliases: HashSet<usize> = checker.description.aliases(known).collect();
    unknowns
        .iter()
        .filter(|unknown| {
            unknown
                .dependencies
                .as_ref()
                .is_some_and(|list| !list.iter().any(|index| aliases.contains(index)))
        })
        .map(|unknown| unknown.variable)
        .filter(|index| !aliases.contains(index))
        .collect()
}

fn judge(
    checker: &Checker,
    known: usize,
    unknowns: Vec<usize>,
    before: Vec<Read>,
    after: Vec<Read>,
    back: Vec<Read>,
) -> Judge {
    let description = checker.description.clone();
    Arc::new(move |run| {
        unknowns.iter().find_map(|unknown| {
            let (one, other) = (value_of(run, &before, *unknown)?, value_of(run, &after, *unknown)?);
            // The old value gives the old result, so the unknown depends on this known.
            let again = value_of(run, &back, *unknown)?;
            let at = one.differ(&other)?;
            let same = |one: &Written, other: &Written| one.differ(other).is_none();
            same(&one, &again).then(|| {
                let (name, of) = (&description.variables[*unknown].name, &description.variables[known].name);
                format!(
                    "{name} goes from {} to {} when {of} changes, and does not list it",
                    one.show(at),
                    other.show(at)
                )
            })
        })
    })
}

/// Inputs and, in Model Exchange, states, moved one at a time.
pub fn missing(checker: &Checker) -> anyhow::Result<()> {
    let description = &checker.description;
    for trajectory in &checker.trajectories {
        let listed = match trajectory.interface {
            Interface::CoSimulation => description.outputs.clone(),
            Interface::ModelExchange => {
                description.outputs.iter().chain(&description.derivatives).cloned().collect()
            }
        };
        let states =
            if trajectory.interface == Interface::ModelExchange { description.states() } else { Vec::new() };
        let scalar = states.len() == description.states_count().unwrap_or(0);
        let inputs = (0..description.variables.len()).filter(|index| {
            let variable = &description.variables[*index];
            variable.causality == "input"
                && variable.is_float()
                && variable.variability == "continuous"
                && !variable.once_per_instant
                && !variable.clocked
        });
        let knowns: Vec<usize> =
            inputs.chain(if scalar { states.clone() } else { Vec::new() }).take(checker.most(60)).collect();
        let to = trajectory.points.len() / 2;
        let mut writer = checker.writer();
        writer.begin(0, trajectory);
        for point in &trajectory.points[..to] {
            writer.point(0, trajectory, point);
        }
        let read = writer.read_these(0, &knowns);
        let now =
            (!states.is_empty() && scalar).then(|| writer.vector(0, "GetContinuousStates", states.len()));
        let now_run = checker.play(&writer.sequence)?;
        let vector = now.and_then(|id| now_run.written(id)).map(|of| of.numbers()).unwrap_or_default();
        for known in knowns {
            let unknowns = undeclared(checker, &listed, known);
            if unknowns.is_empty() {
                continue;
            }
            let variable = &description.variables[known];
            let Some(value) = value_of(&now_run, &read, known).map(|value| value.numbers()) else { continue };
            let other: Vec<f64> = value.iter().map(|value| near(variable, *value, 1.0 / 16.0)).collect();
            let mut writer = checker.writer();
            writer.begin(0, trajectory);
            for point in &trajectory.points[..to] {
                writer.point(0, trajectory, point);
            }
            let set = |writer: &mut crate::writer::Writer, numbers: &[f64]| match states
                .iter()
                .position(|index| *index == known)
            {
                Some(at) => {
                    let mut states = vector.clone();
                    states[at] = numbers[0];
                    writer.set_states(0, &states);
                }
                None => {
                    writer.set(0, &[(known, Value::Numbers(numbers.to_vec()))]);
                }
            };
            set(&mut writer, &value);
            let before = writer.read_these(0, &unknowns);
            set(&mut writer, &other);
            let after = writer.read_these(0, &unknowns);
            set(&mut writer, &value);
            let back = writer.read_these(0, &unknowns);
            checker.judge(
                "dependencies.missing",
                writer.sequence,
                judge(checker, known, unknowns, before, after, back),
            )?;
        }
    }
    Ok(())
}

/// Parameters and inputs, moved one at a time in Initialization Mode.
pub fn initial(checker: &Checker) -> anyhow::Result<()> {
    let description = &checker.description;
    for trajectory in &checker.trajectories {
        let knowns: Vec<usize> = (0..description.variables.len())
            .filter(|index| {
                let variable = &description.variables[*index];
                let known = variable.causality == "input"
                    || variable.initial == "exact" && variable.variability != "constant";
                known
                    && variable.is_float()
                    && variable.causality != "parameter"
                    && !variable.starts().is_empty()
                    && !variable.clocked
            })
            .take(checker.most(60))
            .collect();
        for known in knowns {
            let unknowns = undeclared(checker, &description.initial_unknowns, known);
            if unknowns.is_empty() {
                continue;
            }
            let variable = &description.variables[known];
            let value = variable.starts();
            let other: Vec<f64> = value.iter().map(|value| near(variable, *value, 1.0 / 16.0)).collect();
            let mut writer = checker.writer();
            writer.make(0, trajectory.interface);
            writer.enter(0);
            writer.set(0, &[(known, Value::Numbers(value.clone()))]);
            let before = writer.read_these(0, &unknowns);
            writer.set(0, &[(known, Value::Numbers(other))]);
            let after = writer.read_these(0, &unknowns);
            writer.set(0, &[(known, Value::Numbers(value))]);
            let back = writer.read_these(0, &unknowns);
            checker.judge(
                "dependencies.initial",
                writer.sequence,
                judge(checker, known, unknowns, before, after, back),
            )?;
        }
    }
    Ok(())
}
