//! Checks that saved states contain the parameters, strings and inputs that were set (section 2.1.8 of FMI 2.0.5).

use super::start_values::settable;
use super::states::from_bytes;
use crate::call_sequence::Values;
use crate::checker::Checker;
use crate::finding::{any, unless_fails};
use crate::values::{other_values, start_values};
use crate::writer::Part::{Call, Enter, Leave, Make, Points, ReadAll, Restore, Run, Save};
use crate::writer::Trajectory;

/// Variables, by index, with their values.
type Assigned = Vec<(usize, Values)>;

/// Returns groups of variables. Each group has values that differ from the start values, and the start values. The first group has all
/// variables. A model may reject new values of integers, Booleans and strings, so the other groups are the floating-point variables, and
/// single variables of other types.
fn groups(checker: &Checker) -> Vec<(Assigned, Assigned)> {
    let description = &checker.description;
    let indices: Vec<usize> = settable(checker);
    let is_float = |index: &usize| description.variables[*index].is_float();
    let (floats, others): (Vec<usize>, Vec<usize>) = indices.iter().partition(|index| is_float(index));
    let mut groups = vec![indices.clone()];
    if !floats.is_empty() && !others.is_empty() {
        groups.push(floats);
        groups.extend(others.chunks(1).take(checker.at_most(16)).map(<[usize]>::to_vec));
    }
    let assigned = |indices: Vec<usize>| -> (Assigned, Assigned) {
        let both = indices.into_iter().filter_map(|index| {
            Some(((index, other_values(description, index)?), (index, start_values(description, index)?)))
        });
        both.unzip()
    };
    groups.into_iter().map(assigned).filter(|(values, _)| !values.is_empty()).collect()
}

/// Checks states of instances whose values differ from the start values. The smaller groups are checked only if the model rejects the
/// values of all variables together.
pub fn restore(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    if trajectory.points.is_empty() {
        return Ok(());
    }
    for (number, (values, starts)) in groups(checker).into_iter().enumerate() {
        let accepted = while_initializing(checker, trajectory, &values, &starts)?;
        after_reset(checker, trajectory, &values)?;
        if checker.serializes(trajectory.interface) {
            from_bytes(checker, trajectory, &values, 1)?;
        }
        if accepted && number == 0 {
            break;
        }
    }
    Ok(())
}

/// Checks that a state that was saved in Initialization Mode restores the values after the start values were set. Returns whether the model
/// accepts the values.
fn while_initializing(
    checker: &Checker,
    trajectory: &Trajectory,
    values: &Assigned,
    starts: &Assigned,
) -> anyhow::Result<bool> {
    let indices: Vec<usize> = values.iter().map(|(index, _)| *index).collect();
    let mut writer = checker.writer(trajectory);
    let mut ids = writer.write(0, &[Make, Enter]).ids;
    ids.extend(writer.set(0, values));
    let first = writer.read_anyway(0, &indices);
    ids.extend(writer.write(0, &[Save(0)]).ids);
    ids.extend(writer.set(0, starts));
    ids.extend(writer.write(0, &[Restore(0)]).ids);
    let second = writer.read_anyway(0, &indices);
    // If the state shares memory with the instance, the start values have changed the state, which the second restoration reveals.
    ids.extend(writer.set(0, starts));
    ids.extend(writer.write(0, &[Restore(0)]).ids);
    let third = writer.read_anyway(0, &indices);
    let sequence = writer.sequence;
    let message = "{} was {} when the state was saved; after other values were set and the state was restored, it is {}";
    let criterion = any([checker.differ(&first, &second, message), checker.differ(&first, &third, message)]);
    // Some models reject the values not when they are set, but when a getter calculates with them.
    let reads = first.iter().map(|read| read.id);
    let criterion = unless_fails(&sequence, ids.iter().copied().chain(reads).collect(), criterion);
    let run = checker.evaluate("states.restore-values", sequence, criterion)?;
    Ok(ids.iter().all(|id| run.status(*id).is_none_or(|status| status <= 1)))
}

/// Checks the values and the simulation from a state that is restored after a reset.
fn after_reset(checker: &Checker, trajectory: &Trajectory, values: &Assigned) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let mut ids = writer.write(0, &[Make]).ids;
    ids.extend(writer.set(0, values));
    let [before, first] = writer.groups(0, &[Enter, Leave, Points(1), ReadAll, Save(0), Run(1)]);
    ids.extend(writer.write(0, &[Call("Reset"), Enter, Leave, Restore(0)]).ids);
    let [after, second] = writer.groups(0, &[ReadAll, Run(1)]);
    ids.extend(before.iter().map(|read| read.id));
    let message = "{} was {}, from the state that was restored after a reset it is {}";
    let criterion =
        any([checker.differ(&before, &after, message), checker.continued(&first, &second, message)]);
    let criterion = unless_fails(&writer.sequence, ids, criterion);
    checker.check("states.restore-values", writer.sequence, criterion)
}
