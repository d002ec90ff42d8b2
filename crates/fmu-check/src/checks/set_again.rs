//! Checks that calculations change neither states nor parameters nor exact outputs.

use crate::call_sequence::{Arg, Run};
use crate::checker::Checker;
use crate::finding::any;
use crate::values::near;
use crate::writer::Part::{Begin, Points};
use crate::writer::{Trajectory, Writer, number_of};
use fmi_abi::{Causality, Initial};

/// Checks that setting the same time or the same inputs again changes neither states nor parameters nor exact outputs, because an importer
/// may repeat such calls. In Model Exchange, also checks that the FMU returns the states that the importer has set: a solver integrates
/// from the states that it set, not from others.
pub fn set_again(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let description = &checker.description;
    let states = description.states();
    let mut kept = checker.readable.clone();
    kept.retain(|index| {
        let variable = &description.variables[*index];
        let is_exact = variable.initial == Some(Initial::Exact) && variable.causality != Causality::Input;
        (states.contains(index) || is_exact) && !variable.clocked
    });
    let count = trajectory.points.len() / 2;
    if kept.is_empty() || count == 0 {
        return Ok(());
    }
    let mut writer = Writer::new(description, trajectory, &kept);
    writer.write(0, &[Begin, Points(count)]);
    let point = &trajectory.points[count - 1];
    let before = writer.read(0);
    if trajectory.is_stepped() {
        writer.set(0, &point.inputs);
    } else {
        writer.call(0, "SetTime", vec![Arg::real(point.time)]);
    }
    let after = writer.read(0);
    let mut criteria = vec![checker.differ(&before, &after, "{} is {} and, without a step or an event, {}")];
    let is_scalar = |index: &usize| description.variables[*index].size == Some(1);
    if !trajectory.is_stepped() && states.len() == point.states.len() && states.iter().all(is_scalar) {
        let set = states.iter().zip(&point.states);
        let set: Vec<f64> =
            set.map(|(index, state)| near(&description.variables[*index], *state, 0.5)).collect();
        let id = writer.set_states(0, &set);
        let reads = writer.read_these(0, &states);
        let description = description.clone();
        criteria.push(Box::new(move |run: &Run| {
            let mut pairs = states.iter().zip(&set).filter(|_| run.succeeds(id));
            pairs.find_map(|(index, set)| {
                let read = number_of(run, &reads, *index)?;
                // A model that converts units may round the last digits.
                let is_other = (read - set).abs() > 1e-9 * set.abs().max(1e-9);
                let name = &description.variables[*index].name;
                is_other.then(|| format!("the importer sets {name} to {set:?}, and reads {read:?}"))
            })
        }));
    }
    checker.check("dynamics.set-again", writer.sequence, any(criteria))
}
