//! Checks that a simulation from a restored state equals the first one, in the same instance, in a new instance, and in a new process.

use crate::call_sequence::{Action, Values};
use crate::checker::Checker;
use crate::finding::{any, fails, unless_fails};
use crate::writer::Part::{Begin, Call, Drop, Enter, Free, Leave, Make, Points, ReadAll, Restore, Run, Save};
use crate::writer::Trajectory;

/// Returns the numbers of points after which a state is saved: none, one, half of the points, and all but two. There is at least one point
/// after each of them.
fn saved_at(trajectory: &Trajectory) -> Vec<usize> {
    let count = trajectory.points.len();
    let mut indices = vec![0, 1, count / 2, count.saturating_sub(2)];
    indices.retain(|index| *index < count);
    indices.sort_unstable();
    indices.dedup();
    indices
}

/// Checks that saving a state changes nothing. Then restores the state twice, and checks that both simulations from it equal the first one.
pub fn restore(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    for index in saved_at(trajectory) {
        let mut writer = checker.writer(trajectory);
        let [before, after, first] =
            writer.groups(0, &[Begin, Points(index), ReadAll, Save(0), ReadAll, Run(index)]);
        let [restored, second, restored_again, third] =
            writer.groups(0, &[Restore(0), ReadAll, Run(index), Restore(0), ReadAll, Run(index)]);
        let sequence = writer.sequence;
        let saving = checker.differ(&before, &after, "{} was {}, after the state was saved it is {}");
        let run = checker.evaluate("states.changed-by-saving", sequence.clone(), saving)?;
        let values = "{} was {}, after the state was restored it is {}";
        let values = checker.differ(&before, &restored, values);
        if checker.record("states.restore-values", &run, &sequence, values) {
            continue;
        }
        let values = "{} was {}, after the state was restored a second time it is {}";
        if checker.record("states.twice", &run, &sequence, checker.differ(&before, &restored_again, values)) {
            continue;
        }
        let pairs = [
            ("states.restore", &second, "{} was {}, from the restored state it is {}"),
            ("states.twice", &third, "{} was {}, from the state restored a second time it is {}"),
        ];
        let found = pairs.into_iter().any(|(name, other, message)| {
            checker.record(name, &run, &sequence, checker.continued(&first, other, message))
        });
        if !found {
            let message = "{} was {}, from the restored state it is {}";
            let exactly = [&second, &third].map(|other| checker.differ(&first, other, message));
            checker.record("states.digits", &run, &sequence, any(exactly));
        }
    }
    modes(checker, trajectory)?;
    reused(checker, trajectory)?;
    free_null(checker, trajectory)
}

/// Checks states that were saved before and in Initialization Mode. The state of Initialization Mode is restored after Terminate, the other
/// one while time advances.
fn modes(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    let first = writer.write(0, &[Make, Save(0), Enter, Save(1), Leave, Run(0), Call("Terminate")]).reads;
    let from_initialization = writer.write(0, &[Restore(1), Leave, Run(0)]);
    let from_new = writer.write(0, &[Restore(0), Enter, Leave, Run(0)]);
    let criteria = [
        fails(&writer.sequence, [from_initialization.ids, from_new.ids].concat()),
        checker.continued(
            &first,
            &from_initialization.reads,
            "{} was {}, from the state of Initialization Mode it is {}",
        ),
        checker.continued(&first, &from_new.reads, "{} was {}, from the state of the new instance it is {}"),
    ];
    checker.check("states.modes", writer.sequence, any(criteria))
}

/// Checks that a handle can be used for a second state, and that an instance can switch between two saved states.
fn reused(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    if trajectory.points.len() < 3 {
        return Ok(());
    }
    let mut writer = checker.writer(trajectory);
    writer.write(0, &[Begin, Points(1), Save(0), Save(1)]);
    writer.point(0, &trajectory.points[1]);
    let [values, first] = writer.groups(0, &[ReadAll, Save(1), Run(2)]);
    let [again, second] = writer.groups(0, &[Restore(0), Restore(1), ReadAll, Run(2), Restore(0)]);
    writer.point(0, &trajectory.points[1]);
    let from_first = writer.write(0, &[ReadAll, Drop(0), Drop(1)]).reads;
    let message = "{} was {}, from the state in a used handle it is {}";
    let criteria = [
        checker.differ(&values, &again, message),
        checker.continued(&first, &second, message),
        checker.continued(&values, &from_first, "{} was {}, from the other state it is {}"),
    ];
    checker.check("states.several", writer.sequence, any(criteria))
}

/// Checks that freeing NULL succeeds and that freeing a state sets its handle to NULL.
fn free_null(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.write(0, &[Begin, Save(0)]);
    let ids = writer.write(0, &[Drop(0), Drop(1)]).ids;
    checker.check("states.free", writer.sequence, move |run| {
        let (freed, nothing) = (ids[0], ids[1]);
        if run.status(nothing).is_some_and(|status| status > 1) {
            return Some("freeing a state that is NULL is rejected".to_owned());
        }
        let is_kept = run.status(freed) == Some(0) && run.written(freed)?.numbers() != [0.0];
        is_kept.then(|| "the handle of a freed state is not NULL".to_owned())
    })
}

/// Checks states that are serialized after several numbers of points, and that the bytes of a deserialized state are the same.
pub fn serialized(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    for index in saved_at(trajectory) {
        from_bytes(checker, trajectory, &[], index)?;
    }
    serialized_again(checker, trajectory)
}

/// Checks that a simulation from a serialized state equals the first one, in a new instance of the same process and of a new process. The
/// state is saved after this number of points in an instance with these values, which the model may reject.
pub fn from_bytes(
    checker: &Checker,
    trajectory: &Trajectory,
    values: &[(usize, Values)],
    index: usize,
) -> anyhow::Result<()> {
    for fresh in [false, true] {
        let mut writer = checker.writer(trajectory);
        let mut ids = vec![writer.make(0)];
        ids.extend(writer.set(0, values));
        let [before] = writer.groups(0, &[Enter, Leave, Points(index), ReadAll]);
        let save = writer.write(0, &[Save(0)]).ids;
        let serialize = writer.serialize(0, 0);
        let [first] = writer.groups(0, &[Run(index)]);
        if fresh {
            writer.add(Action::FreshProcess);
        } else {
            writer.write(0, &[Drop(0), Free]);
        }
        // An importer may restore a state after the instantiation or after the initialization, so both are tried.
        let begin = writer.write(1, &[if index == 0 && fresh { Make } else { Begin }]).ids;
        let restore = [writer.deserialize(1, 0, 1), writer.write(1, &[Restore(1)]).ids[0]];
        let [restored, second] = writer.groups(1, &[ReadAll, Run(index)]);
        let message = "{} was {}, from the bytes it is {}";
        let criterion = any([
            fails(&writer.sequence, restore.to_vec()),
            checker.differ(&before, &restored, message),
            checker.continued(&first, &second, message),
        ]);
        // Some models reject values not when they are set, but when a getter calculates with them.
        if !values.is_empty() {
            ids.extend(before.iter().map(|read| read.id).chain(save).chain(begin).chain(restore));
        }
        let criterion = unless_fails(&writer.sequence, ids, criterion);
        let name = if fresh { "states.fresh-process" } else { "states.serialized" };
        checker.check(name, writer.sequence, move |run| {
            serialize.iter().all(|id| run.succeeds(*id)).then(|| criterion(run))?
        })?;
    }
    Ok(())
}

/// Checks that a deserialized state is serialized to the same bytes.
fn serialized_again(checker: &Checker, trajectory: &Trajectory) -> anyhow::Result<()> {
    let mut writer = checker.writer(trajectory);
    writer.write(0, &[Begin, Points(trajectory.points.len() / 2), Save(0)]);
    let [_, first] = writer.serialize(0, 0);
    writer.deserialize(0, 0, 1);
    let [_, second] = writer.serialize(0, 1);
    checker.check("states.bytes", writer.sequence, move |run| {
        let (one, two) = (run.written(first)?, run.written(second)?);
        match (one, two) {
            (Values::Numbers(_, one), Values::Numbers(_, two)) if one.len() != two.len() => {
                Some(format!("{} bytes, and {} of the same state", one.len(), two.len()))
            }
            _ => one.differ(two).map(|index| format!("byte {index} of {} differs", one.numbers().len())),
        }
    })
}
