//! Checks that saved states contain the values that were set: parameters, strings and inputs (section 2.1.8 of FMI 2.0.5).

use super::start_values::settable;
use crate::call_sequence::{Step, Values};
use crate::checker::Checker;
use crate::description::Description;
use crate::finding::{any, failure};
use crate::values::other_values;
use crate::writer::Part::{Begin, Call, Enter, Free, Leave, Make, Points, ReadAll, Restore, Run, Save};
use crate::writer::Trajectory;
use fmi_abi::BaseType;

/// Variables, by index, with their values.
type Assigned = Vec<(usize, Values)>;

/// Returns the start values of a variable.
fn starts(description: &Description, index: usize) -> Option<Values> {
    let variable = &description.variables[index];
    match variable.base? {
        BaseType::String => {
            let texts =
                (0..variable.size?).map(|element| Some(variable.start_of(element)?.as_bytes().to_owned()));
            Some(Values::Strings(texts.collect()))
        }
        BaseType::Binary => None,
        _ => {
            let values = Values::new(description.kind(index), variable.starts());
            (variable.starts().len() == variable.size?).then_some(values)
        }
    }
}

/// Returns groups of variables with other values and with their start values. A model may reject new values of integers, Booleans and
/// strings, so that these variables are also set without the others.
fn groups(checker: &Checker) -> Vec<(Assigned, Assigned)> {
    let description = &checker.description;
    let indices: Vec<usize> = settable(checker);
    let is_float = |index: &usize| description.variables[*index].is_float();
    let (floats, others): (Vec<usize>, Vec<usize>) = indices.iter().partition(|index| is_float(index));
    let mut sets = vec![indices.clone()];
    if !floats.is_empty() && !others.is_empty() {
        sets.push(floats);
        sets.extend(others.chunks(1).take(checker.at_most(16)).map(<[usize]>::to_vec));
    }
    let assigned = |indices: Vec<usize>| -> (Assigned, Assigned) {
        let both = indices.into_iter().filter_map(|index| {
            Some(((index, other_values(description, index)?), (index, starts(description, index)?)))
        });
        both.unzip()
    };
    sets.into_iter().map(assigned).filter(|(values, _)| !values.is_empty()).collect()
}

/// Checks states of instances with other values than the start values. If the model accepts all variables together, the
/// smaller groups are left out.
pub fn restore(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    if trajectory.points.is_empty() {
        return Ok(());
    }
    for (number, (values, starts)) in groups(checker).into_iter().enumerate() {
        let accepted = while_initializing(checker, trajectory, &values, &starts)?;
        after_reset(checker, trajectory, &values)?;
        if checker.serializes(trajectory.interface) {
            in_fresh_process(checker, trajectory, &values)?;
        }
        if accepted && number == 0 {
            break;
        }
    }
    Ok(())
}

/// Checks a state that is restored after the start values were set in Initialization Mode. Returns whether the model accepts the values.
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
    // The second restoration reveals memory that states and instances share.
    ids.extend(writer.set(0, starts));
    ids.extend(writer.write(0, &[Restore(0)]).ids);
    let third = writer.read_anyway(0, &indices);
    let sequence = writer.sequence.clone();
    let message = "{} was {} when the state was saved; after other values were set and the state was restored, it is {}";
    let criterion = any([checker.differ(&first, &second, message), checker.differ(&first, &third, message)]);
    let (copy, all) = (sequence.clone(), ids.clone());
    // A model may reject the values only when it calculates with them.
    ids.extend(first.iter().map(|read| read.id));
    let run = checker.evaluate("states.restore-values", sequence, move |run| {
        failure(&copy, run, &ids).is_none().then(|| criterion(run))?
    })?;
    Ok(all.iter().all(|id| run.status(*id).is_none_or(|status| status <= 1)))
}

/// Checks a state that is restored after a reset, and the simulation from it.
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
    let sequence = writer.sequence.clone();
    checker.check("states.restore-values", writer.sequence, move |run| {
        failure(&sequence, run, &ids).is_none().then(|| criterion(run))?
    })
}

/// Checks the bytes of a state, which are read by a new instance with the start values and in a new process.
fn in_fresh_process(checker: &Checker, trajectory: &Trajectory, values: &Assigned) -> anyhow::Result<()> {
    for fresh in [false, true] {
        let mut writer = checker.writer(trajectory);
        let mut ids = writer.write(0, &[Make]).ids;
        ids.extend(writer.set(0, values));
        let [before] = writer.groups(0, &[Enter, Leave, Points(1), ReadAll]);
        ids.extend(writer.write(0, &[Save(0)]).ids);
        ids.extend(writer.serialize(0, 0));
        let [first] = writer.groups(0, &[Run(1)]);
        if fresh {
            writer.add(Step::FreshProcess);
        } else {
            writer.write(0, &[Free]);
        }
        ids.extend(writer.write(1, &[Begin]).ids);
        ids.push(writer.deserialize(1, 0, 1));
        ids.extend(writer.write(1, &[Restore(1)]).ids);
        let [after, second] = writer.groups(1, &[ReadAll, Run(1)]);
        ids.extend(before.iter().map(|read| read.id));
        let message = "{} was {}, from the bytes it is {}";
        let criterion =
            any([checker.differ(&before, &after, message), checker.continued(&first, &second, message)]);
        let sequence = writer.sequence.clone();
        let name = if fresh { "states.fresh-process" } else { "states.serialized" };
        checker.check(name, writer.sequence, move |run| {
            failure(&sequence, run, &ids).is_none().then(|| criterion(run))?
        })?;
    }
    Ok(())
}
